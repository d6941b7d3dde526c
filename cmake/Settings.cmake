# SPDX-License-Identifier: AGPL-3.0-or-later
# Compiler settings that hold for every target.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
set(CMAKE_CXX_FLAGS_RELEASE "-O2")

# One instruction set for all targets: Eigen's alignment depends on it, so mixing would break the ABI between folders.
set(VOROCAST_MARCH "x86-64-v3" CACHE STRING "Instruction set (-march); x86-64-v3 needs AVX2 and FMA. Empty: the compiler's default")
if(VOROCAST_MARCH)
  add_compile_options(-march=${VOROCAST_MARCH})
endif()
# Results must not depend on how the compiler contracts a*b+c across builds of one source.
add_compile_options(-ffp-contract=off)

set(VOROCAST_SANITIZE "" CACHE STRING "Sanitizers, for example address,undefined or thread")
if(VOROCAST_SANITIZE)
  add_compile_options(-fsanitize=${VOROCAST_SANITIZE} -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=${VOROCAST_SANITIZE})
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
endif()

add_library(vorocast_warnings INTERFACE)
target_compile_options(vorocast_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wno-missing-field-initializers)
option(VOROCAST_WERROR "Treat warnings as errors" ON)
if(VOROCAST_WERROR)
  target_compile_options(vorocast_warnings INTERFACE -Werror)
endif()

# The fuzzers (tests/fuzz) see inside every folder. Without this option they are built with a driver of their own, by any compiler.
option(VOROCAST_FUZZ "Build the fuzzers for libFuzzer, everything instrumented (clang only)" OFF)
if(VOROCAST_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "VOROCAST_FUZZ needs clang: configure with -DCMAKE_CXX_COMPILER=clang++")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=address,undefined)
endif()
