# SPDX-License-Identifier: AGPL-3.0-or-later
# The collision tests hold the cells' own contacts to Bullet's; the service's tests run the real program.
target_link_libraries(tests_unit_services_simulation PRIVATE PkgConfig::BULLET services_storage services_tasks services_rpc proto)
target_compile_definitions(tests_unit_services_simulation PRIVATE VOROCAST_SIMULATION="$<TARGET_FILE:vorocast-simulation>" VOROCAST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
add_dependencies(tests_unit_services_simulation vorocast-simulation)
