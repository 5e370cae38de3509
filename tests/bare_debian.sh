#!/bin/sh
# A wheel in a bare Debian 12 that has Python and no compiler: makes the system in FOLDER unless it is there (debootstrap,
# 300 MB, needs root), installs the wheel and what it requires into a new environment there, settles a scene of the
# repository, ramps it and looks for its onset, on one rank and on two.
#
#     tests/bare_debian.sh WHEEL FOLDER
#
# pip in there takes the settings that PIP_* of this shell name, and the certificates of this machine.
set -eu
wheel=$1
folder=$2
here=$(dirname "$0")

if [ ! -x "$folder/usr/bin/python3" ]; then
    debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates bookworm "$folder"
fi
cp /etc/resolv.conf "$folder/etc/resolv.conf"
cp /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/"
rm -rf "$folder/trial"
mkdir "$folder/trial"
cp "$wheel" "$here/../scenes/paper.toml" "$folder/trial"

mount -t proc proc "$folder/proc"
mount -t sysfs sysfs "$folder/sys"
mount -t tmpfs tmpfs "$folder/dev/shm"
trap 'umount "$folder/proc" "$folder/sys" "$folder/dev/shm"' EXIT

PIP_CERT=/etc/ssl/certs/ca-certificates.crt chroot "$folder" /bin/sh -eu <<'EOF'
cd /trial
if command -v cc || command -v gcc || command -v g++ || command -v clang; then
    echo "there is a compiler" >&2
    exit 1
fi
python3 -m venv fresh
fresh/bin/pip install --quiet --only-binary :all: ./*.whl
export PATH=/trial/fresh/bin:$PATH OMP_NUM_THREADS=1
faultgouge --version
faultgouge settle paper.toml -o settled.h5
faultgouge ramp paper.toml -o run.h5
faultgouge onset paper.toml -o one.json
mpiexec -n 2 faultgouge onset paper.toml -o two.json
cmp one.json two.json
EOF
