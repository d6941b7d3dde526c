# SPDX-License-Identifier: AGPL-3.0-or-later
# Draco encodes the test files; the folder under test only decodes.
target_link_libraries(tests_unit_services_capture PRIVATE draco::draco)
target_compile_definitions(tests_unit_services_capture PRIVATE VOROCAST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
