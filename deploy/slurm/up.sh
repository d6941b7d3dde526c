#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Brings up a real Slurm on this one machine, under one folder and as the current user: a controller, several nodes, a munge of its own.
# For tests and for trying out; a cluster that exists needs only what site.conf.example says.
#
#   deploy/slurm/up.sh FOLDER [NODES] [CPUS_A_NODE] [FIRST_PORT]     then:  export SLURM_CONF=FOLDER/slurm.conf; sinfo
#   deploy/slurm/down.sh FOLDER
#
# FIRST_PORT is the controller's; the nodes take the ones after it. Run again on the same folder, it starts what does not run any more.
set -euo pipefail

if [ $# -lt 1 ]; then
  sed -n '3,9s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
nodes=${2:-3} cpus=${3:-2} port=${4:-16817}
here=$(cd "$(dirname "$0")" && pwd)
export PATH=$PATH:/usr/sbin:/sbin
for program in slurmctld slurmd munged sbatch; do
  command -v "$program" >/dev/null || { echo "up.sh: $program is missing: deploy/install_packages.sh installs it" >&2; exit 3; }
done
mkdir -p "$1"
folder=$(cd "$1" && pwd)
cd "$folder"
mkdir -p state spool log munge
chmod 0711 munge

# Munge proves who a command comes from. The key is this folder's own.
if [ ! -e munge/key ]; then
  (umask 077 && head -c 1024 /dev/urandom >munge/key)
fi

if [ ! -e slurm.conf ]; then
  host=$(hostname -s)
  {
    cat <<CONF
ClusterName=vorocast
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd-%n.log
AuthType=auth/munge
# Credentials that outlive a job by more make a requeue wait for a minute and a half.
AuthInfo=socket=$folder/munge/socket,cred_expire=5
CredType=cred/munge
# Several nodes on one machine: the nodes' sizes are those written below, and nothing is confined.
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
SlurmdTimeout=10
CompleteWait=0
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
CONF
    sed -n '/^# ---- Begin/,$p' "$here/site.conf.example" | sed "s/NODES/node[1-$nodes]/"
    for i in $(seq 1 "$nodes"); do
      echo "NodeName=node$i NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + i)) CPUs=$cpus RealMemory=1000 State=UNKNOWN"
    done
  } >slurm.conf
fi
export SLURM_CONF=$folder/slurm.conf
nodes=$(grep -c '^NodeName=' slurm.conf)

# runs FILE PROGRAM: whether the process whose number is in FILE is that program.
runs() { [ -s "$1" ] && [ "$(cat "/proc/$(cat "$1")/comm" 2>/dev/null)" = "$2" ] && ! grep -q '^State:.*Z' "/proc/$(cat "$1")/status"; }

if ! runs munge/pid munged; then
  rm -f munge/socket munge/socket.lock
  munged --force --socket="$folder/munge/socket" --key-file="$folder/munge/key" --pid-file="$folder/munge/pid" \
    --log-file="$folder/log/munged.log" --seed-file="$folder/munge/seed" --num-threads=2
fi
# Never with -c: it would forget its jobs.
runs slurmctld.pid slurmctld || slurmctld
for i in $(seq 1 "$nodes"); do
  runs "slurmd-node$i.pid" slurmd || slurmd -N "node$i"
done

deadline=$((SECONDS + 60))
until [ "$(sinfo --noheader --Node --partition=farm --states=idle,mixed,allocated,completing --format=%N 2>/dev/null | sort -u | wc -l)" -eq "$nodes" ]; do
  if [ $SECONDS -ge $deadline ]; then
    echo "up.sh: not all nodes came up within a minute; see $folder/log" >&2
    exit 1
  fi
  sleep 0.2
done
echo "Slurm runs with $nodes nodes: export SLURM_CONF=$SLURM_CONF"
