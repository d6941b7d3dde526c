# SPDX-License-Identifier: AGPL-3.0-or-later
# The tests read pictures back with libpng itself.
target_link_libraries(tests_unit_services_rendering PRIVATE PNG::PNG)
# The OpenEXR library reads back what film_test.cpp writes.
target_link_libraries(tests_unit_services_rendering PRIVATE PkgConfig::OPENEXR nlohmann_json::nlohmann_json)
