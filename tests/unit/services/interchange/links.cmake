# SPDX-License-Identifier: AGPL-3.0-or-later
# A reader that is not ours opens what the exporters write.
target_link_libraries(tests_unit_services_interchange PRIVATE services_storage PkgConfig::ASSIMP)
