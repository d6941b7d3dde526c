#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Runs every benchmark of a build folder, one after the other, and gathers their cases in BUILD_FOLDER/bench.json. A benchmark that fails does not keep
# the others from running; the exit code tells of it at the end.
set -uo pipefail
build=${1:?usage: run_benchmarks.sh BUILD_FOLDER}
cases=$(mktemp --directory) || exit 1
trap 'rm --recursive --force "$cases"' EXIT
failed=()
for benchmark in "$build"/bin/bench_*; do
  name=$(basename "$benchmark")
  echo "== $name"
  "$benchmark" --json "$cases/$name.json" || failed+=("$name")
  echo
done
python3 - "$build/bench.json" "$cases"/*.json <<'PYTHON' || exit 1
import json, pathlib, sys
files = [pathlib.Path(name) for name in sys.argv[2:]]
cases = [case for file in files if file.exists() for case in json.loads(file.read_text())]
pathlib.Path(sys.argv[1]).write_text(json.dumps(cases, indent=2) + "\n")
print(f"{len(cases)} cases in {sys.argv[1]}")
PYTHON
if [ ${#failed[@]} -gt 0 ]; then
  echo "failed: ${failed[*]}" >&2
  exit 1
fi
