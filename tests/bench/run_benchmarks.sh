#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Runs every benchmark of a build folder, one after the other; each prints CPU time and quality beside its goal or peer.
set -euo pipefail
build=${1:?usage: run_benchmarks.sh BUILD_FOLDER}
for benchmark in "$build"/bin/bench_*; do
  echo "== $(basename "$benchmark")"
  "$benchmark"
  echo
done
