# SPDX-License-Identifier: AGPL-3.0-or-later
# Every third-party library, found once. A folder names the ones it owns in its own CMakeLists.txt.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(absl REQUIRED)
find_package(Protobuf REQUIRED)
find_package(gRPC CONFIG REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(prometheus-cpp CONFIG REQUIRED)
find_package(OpenSSL REQUIRED)
find_package(PNG REQUIRED)
find_package(draco REQUIRED)
find_package(CGAL REQUIRED)
find_package(embree 3 REQUIRED)
find_package(HDF5 REQUIRED COMPONENTS C)
pkg_check_modules(FFTW3 REQUIRED IMPORTED_TARGET fftw3f fftw3)
pkg_check_modules(TINYGLTF REQUIRED IMPORTED_TARGET tinygltf)
pkg_check_modules(ASSIMP REQUIRED IMPORTED_TARGET assimp)  # tests: opens what is exported
pkg_check_modules(BULLET REQUIRED IMPORTED_TARGET bullet)
pkg_check_modules(OPENEXR REQUIRED IMPORTED_TARGET OpenEXR)
pkg_check_modules(MURMURHASH REQUIRED IMPORTED_TARGET libmurmurhash)
pkg_check_modules(SQLITE REQUIRED IMPORTED_TARGET sqlite3)
pkg_check_modules(POSTGRES REQUIRED IMPORTED_TARGET libpq)
find_library(TETGEN_LIBRARY tet REQUIRED)

# CGAL asks for -frounding-math wherever it is linked, which slows the kernels beside it: only the sources that include CGAL need it
# (vorocast_uses_cgal()).
get_target_property(cgal_target CGAL::CGAL ALIASED_TARGET)
set_target_properties(${cgal_target} PROPERTIES INTERFACE_COMPILE_OPTIONS "")
function(vorocast_uses_cgal)
  set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS -frounding-math)
endfunction()

# Packages without a target of their own.
add_library(hdf5_c INTERFACE IMPORTED)
target_include_directories(hdf5_c INTERFACE ${HDF5_C_INCLUDE_DIRS})
target_link_libraries(hdf5_c INTERFACE ${HDF5_C_LIBRARIES})
add_library(tetgen INTERFACE IMPORTED)
target_compile_definitions(tetgen INTERFACE TETLIBRARY)
target_link_libraries(tetgen INTERFACE ${TETGEN_LIBRARY})
