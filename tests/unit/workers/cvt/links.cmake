# SPDX-License-Identifier: AGPL-3.0-or-later
# CGAL's exact distances are the truth that surfaces are held to; captures lie beside the source tree.
target_link_libraries(tests_unit_workers_cvt PRIVATE CGAL::CGAL)
target_compile_definitions(tests_unit_workers_cvt PRIVATE VOROCAST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
file(GLOB cgal_tests ${CMAKE_CURRENT_LIST_DIR}/indicator_*_test.cpp)
vorocast_uses_cgal(${cgal_tests})
