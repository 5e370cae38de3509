"""A plugin that was compiled for another LAMMPS says so in one sentence, and registers nothing."""

import shutil
import subprocess
from importlib.metadata import distribution
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "pair_mindlin_smooth" / "mindlinsmoothplugin.cpp"
LAMMPS = "{:0>4}{:0>2}{:0>2}".format(*distribution("lammps").version.split(".")[:3])
THIS = f"-DFAULTGOUGE_LAMMPS_VERSION={LAMMPS}"
OPEN_MPI = "#include_next <mpi.h>\n#undef MPICH_VERSION\n#define OPEN_MPI 1\n"

CASES = {
    "another release": (
        ["-DFAULTGOUGE_LAMMPS_VERSION=20230802", "-DLAMMPS_SMALLBIG"],
        f"was compiled for LAMMPS 20230802 and does not work with LAMMPS {LAMMPS}:",
    ),
    "other sizes": (
        [THIS, "-DLAMMPS_BIGBIG"],
        "for atom IDs of 64 bits and does not work with this LAMMPS, whose IDs have 32 (-DLAMMPS_SIZES=smallbig",
    ),
    "another MPI": (
        [THIS, "-DLAMMPS_SMALLBIG", "-Iopen_mpi"],
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
    compiler = [shutil.which("g++") or shutil.which("c++"), "-std=c++17", "-O0", "-fPIC", "-DMPICH_SKIP_MPICXX"]
    compiler += [f"-isystem{lammps.locate_file('lammps/include/lammps')}", f"-isystem{mpi}"]
    (tmp_path / "open_mpi").mkdir()
    (tmp_path / "open_mpi" / "mpi.h").write_text(OPEN_MPI)
    for command in (
        [*compiler, *flags, "-c", SOURCE, "-o", "other.o"],
        ["objcopy", "--weaken", "other.o"],  # the styles that it would register need not be there
        [*compiler, "-shared", "other.o", "-Wl,--wrap=_ZSt28__throw_bad_array_new_lengthv", "-o", "otherplugin.so"],
    ):
        subprocess.run(command, cwd=tmp_path, check=True)
    load = f"plugin unload pair mindlin/smooth\nplugin load {tmp_path / 'otherplugin.so'}\n"
    done = lmp(f"{load}pair_style mindlin/smooth 1 1 1\n", fails=True)
    (line,) = (line for line in (done.stdout + done.stderr).splitlines() if "the faultgouge plugin" in line)
    assert says in line
    assert "build it for this LAMMPS: pip install --no-build-isolation" in line
    assert "Unrecognized pair style 'mindlin/smooth'" in done.stdout
