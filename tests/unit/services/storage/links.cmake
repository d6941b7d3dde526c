# SPDX-License-Identifier: AGPL-3.0-or-later
# Some tests look through the folder's own reader, whose header names HDF5's types.
target_link_libraries(tests_unit_services_storage PRIVATE hdf5_c)
