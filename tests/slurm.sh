#!/usr/bin/env bash
# Runs the scripts of docs/howto_cluster.md, as printed, on a SLURM of one node that this script starts. As root, on Debian:
#   apt-get install slurmctld slurmd slurm-client munge
#   tests/slurm.sh FOLDER
# $HOME/faultgouge is the environment that the page installs. The node claims 16 cores, whatever it has.
# The script for decks on a cluster's own LAMMPS is not run: it needs that cluster's modules.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
folder=$(mkdir -p "$1" && cd "$1" && pwd)
host=$(hostname -s)

start_slurm() {
  sinfo >"$folder/sinfo" 2>&1 && return
  mkdir -p /etc/slurm /run/munge /var/spool/slurmctld /var/spool/slurmd
  chown munge /run/munge
  pgrep -x munged >/dev/null || su -s /bin/sh munge -c /usr/sbin/munged
  cat >/etc/slurm/slurm.conf <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
StateSaveLocation=/var/spool/slurmctld
SlurmdSpoolDir=/var/spool/slurmd
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=16 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
  slurmctld
  slurmd
  sleep 5
}

# the scripts of the page, one a file: blocks of four spaces that begin with #!/bin/bash
scripts() {
  python3 - "$root/docs/howto_cluster.md" "$folder" <<'PY'
import re, sys
from pathlib import Path
page, folder = Path(sys.argv[1]).read_text(), Path(sys.argv[2])
for block in re.findall(r"((?:^    .*\n|^\n)+)", page, re.MULTILINE):
    text = re.sub(r"^    ", "", block.strip("\n"), flags=re.MULTILINE)
    name = re.search(r"faultgouge (\w+) ", text)
    if text.startswith("#!/bin/bash") and name:
        (folder / f"{name[1]}.sh").write_text(text + "\n")
PY
}

start_slurm
scripts
cd "$folder"
cp "$root/scenes/large.toml" large.toml
sed -i 's/^until *=.*/until = 2e-3/; s/^step *=.*/step = 1e-3/; s/^disks *=.*/disks = 400/; s/^top *=.*/top = 40/; s/^width *=.*/width = 23.8/' large.toml
cat >sweep.toml <<'SWEEP'
task = "onset"
[sweep]
"packing.seed" = "1:16"
[scene.packing]
disks = 30
top = 5
width = 6.0
[scene.law]
kn = 2e5
[scene.load]
fy = 3.0
[scene.ramp]
step = 5e-3
until = 0.025
SWEEP
sbatch --wait ramp.sh
cat >settled.toml <<'SCENE'
[packing]
file = "run.h5"
[law]
kn = 2e5
[load]
fy = 3.0
[ramp]
step = 1e-3
until = 2e-2
SCENE
sbatch --wait sweep.sh
sbatch --wait onset.sh
"$HOME/faultgouge/bin/faultgouge" merge part1 part2 part3 part4 part5 part6 part7 part8 -o all
test "$(wc -l <all/results.csv)" = 17
test -s onset.json
for job in 1 2 3 4; do cmp onset.json "onset$job.json"; done
cat slurm-*.out
