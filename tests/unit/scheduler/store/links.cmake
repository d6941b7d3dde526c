# SPDX-License-Identifier: AGPL-3.0-or-later
target_link_libraries(tests_unit_scheduler_store PRIVATE PkgConfig::SQLITE PkgConfig::POSTGRES)
