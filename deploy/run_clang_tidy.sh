#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Runs clang-tidy on the project's own sources, with the compile commands of the given build folder.
set -euo pipefail
build=${1:?usage: run_clang_tidy.sh BUILD_FOLDER [FILE ...]}
shift
cmake --build "$build" --target proto >/dev/null
if [ $# -gt 0 ]; then files=("$@"); else mapfile -t files < <(git ls-files 'services/*.cpp' 'workers/*.cpp' 'scheduler/*.cpp'); fi
printf '%s\0' "${files[@]}" | xargs -0 -P "$(nproc)" -n 1 clang-tidy-14 --quiet -p "$build"
