#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Takes down what up.sh brought up under a folder: jobs first, then the nodes, the controller and munge. The folder stays.
set -uo pipefail

if [ $# -ne 1 ] || [ ! -e "$1/slurm.conf" ]; then
  echo "down.sh FOLDER: the folder that up.sh was given" >&2
  exit 2
fi
folder=$(cd "$1" && pwd)
export SLURM_CONF=$folder/slurm.conf
timeout 10 scancel --quiet --state=PENDING --user="$(id -un)" 2>/dev/null
timeout 10 scancel --quiet --user="$(id -un)" 2>/dev/null
deadline=$((SECONDS + 10))
while [ $SECONDS -lt $deadline ] && [ -n "$(timeout 5 squeue --noheader 2>/dev/null)" ]; do sleep 0.2; done

# What is left of jobs has the folder in its environment; only processes of this Slurm do.
stop() {  # FILE PROGRAM SIGNAL
  local pid
  pid=$(cat "$1" 2>/dev/null) || return 0
  [ "$(cat "/proc/$pid/comm" 2>/dev/null)" = "$2" ] || return 0
  kill "-$3" "$pid" 2>/dev/null
  for _ in $(seq 50); do
    kill -0 "$pid" 2>/dev/null || return 0
    sleep 0.1
  done
  kill -KILL "$pid" 2>/dev/null
}
for file in "$folder"/slurmd-*.pid; do stop "$file" slurmd TERM; done
stop "$folder/slurmctld.pid" slurmctld TERM
for proc in /proc/[0-9]*; do
  [ "$(cat "$proc/comm" 2>/dev/null)" = slurmstepd ] || continue
  tr '\0' '\n' <"$proc/environ" 2>/dev/null | grep -qxF "SLURM_CONF=$SLURM_CONF" && kill -KILL "${proc#/proc/}" 2>/dev/null
done
stop "$folder/munge/pid" munged TERM
exit 0
