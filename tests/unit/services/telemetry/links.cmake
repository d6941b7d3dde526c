# SPDX-License-Identifier: AGPL-3.0-or-later
target_link_libraries(tests_unit_services_telemetry PRIVATE spdlog::spdlog nlohmann_json::nlohmann_json)
