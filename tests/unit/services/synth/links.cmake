# SPDX-License-Identifier: AGPL-3.0-or-later
target_link_libraries(tests_unit_services_synth PRIVATE services_storage services_capture embree)
target_compile_definitions(tests_unit_services_synth PRIVATE VOROCAST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
