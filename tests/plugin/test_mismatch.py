"""A plugin that was compiled for another LAMMPS says so in one sentence, and registers nothing."""

import shutil
import subprocess
from importlib.metadata import distribution
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "pair_mindlin_smooth"
LAMMPS = "{:0>4}{:0>2}{:0>2}".format(*distribution("lammps").version.split(".")[:3])
OPEN_MPI = "#include_next <mpi.h>\n#undef MPICH_VERSION\n#define OPEN_MPI 1\n"

CASES = {
    "another release": (
        ["-DFAULTGOUGE_LAMMPS_VERSION=20230802", "-DLAMMPS_SMALLBIG"],
        f"was compiled for LAMMPS 20230802 and does not work with LAMMPS {LAMMPS}:",
    ),
    "other sizes": (
        [f"-DFAULTGOUGE_LAMMPS_VERSION={LAMMPS}", "-DLAMMPS_BIGBIG"],
        "was compiled for atom IDs of 64 bits and does not work with this LAMMPS, whose IDs have 32 "
        "(-DLAMMPS_SIZES=smallbig or bigbig):",
    ),
    "another MPI": (
        [f"-DFAULTGOUGE_LAMMPS_VERSION={LAMMPS}", "-DLAMMPS_SMALLBIG", "-Iopen_mpi"],
        "was compiled for the MPI of Open MPI and does not work with this LAMMPS, whose MPI is MPICH",
    ),
}


# each of them compiles the plugin; the others find out in the same way
@pytest.mark.parametrize(
    ("flags", "says"),
    [pytest.param(*case, marks=pytest.mark.long if k else pytest.mark.slow) for k, case in enumerate(CASES.values())],
    ids=CASES,
)
def test_it_says_what_does_not_fit(lmp, tmp_path, flags, says):
    lammps, mpich = distribution("lammps"), distribution("mpich")
    mpi = next(file for file in mpich.files if file.name == "mpi.h").locate().resolve().parent
    headers = f"-isystem{lammps.locate_file('lammps/include/lammps')}", f"-isystem{mpi}"
    command = shutil.which("g++") or shutil.which("c++")
    compiler = [command, "-std=c++17", "-O0", "-fPIC", "-DMPICH_SKIP_MPICXX", *headers]
    (tmp_path / "open_mpi").mkdir()
    (tmp_path / "open_mpi" / "mpi.h").write_text(OPEN_MPI)
    built, plugin = tmp_path / "other.o", tmp_path / "otherplugin.so"
    registers = [*compiler, *flags, "-c", SOURCES / "mindlinsmoothplugin.cpp", "-o", built]
    weaken = ["objcopy", "--weaken", built]  # the styles that it would register need not be there
    link = [*compiler, "-shared", built, "-Wl,--wrap=_ZSt28__throw_bad_array_new_lengthv", "-o", plugin]
    for command in (registers, weaken, link):
        subprocess.run(command, cwd=tmp_path, check=True)
    done = lmp(
        f"plugin unload pair mindlin/smooth\nplugin load {plugin}\npair_style mindlin/smooth 1 1 1\n", fails=True
    )
    (line,) = (line for line in (done.stdout + done.stderr).splitlines() if "the faultgouge plugin" in line)
    assert says in line
    assert "build it for this LAMMPS: pip install --no-build-isolation" in line
    assert "Unrecognized pair style 'mindlin/smooth'" in done.stdout
