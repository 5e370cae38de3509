"""The gallery: each example of `faultgouge examples`, run in an empty folder, with what it prints and a picture.

conf.py has it made before the pages are built; docs/auto_gallery is not kept.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from textwrap import dedent

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "scenes" / "examples"
DECK = "faultgouge import {0}.in -o {0}.h5 && faultgouge draw {0}.h5"
RAMP = "faultgouge ramp {0}.toml && faultgouge draw run.h5 --mode pair"

SHOWN = {
    "pour": ("Poured spheres", DECK),
    "slope": ("A bed on a slope", DECK),
    "lid": ("A layer under a lid", DECK),
    "fcc": ("A crystal whose moduli are known", "faultgouge vibrations fcc.in -o vibrations"),
    "scene": ("A layer under shear", RAMP),
    "damped": ("The layer with dashpots", RAMP),
    "drive": ("A layer that sticks and slips", "faultgouge draw drive.h5 -o picture.png"),
    "disks": ("A table of a laboratory", "faultgouge draw disks.h5"),
    "sweep": ("Eight packings", ""),
    "own_law": ("A law of one's own", ""),
}
"""Title of each example, and the command that draws it."""

PICTURES = ("picture.png", "vibrations/density.png", "sweep/results.png")


def lines_of(output: str, most: int = 12) -> str:
    """What a command prints, without more lines than fit a screen."""
    lines = output.rstrip().splitlines()
    return "\n".join([*lines[:most], "..."] if len(lines) > most + 1 else lines)


def section(name: str, folder: Path) -> str:
    """Run an example, keep its picture in a folder, and give its part of the page."""
    (source,) = EXAMPLES.glob(f"{name}.*")
    what, command, *_ = (line.strip('# "') for line in source.read_text().splitlines())
    title, draws = SHOWN[name]
    with tempfile.TemporaryDirectory() as empty:
        (bin_folder := Path(empty, "bin")).mkdir()
        (bin_folder / "faultgouge").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m faultgouge "$@"\n')
        (bin_folder / "faultgouge").chmod(0o755)
        text = f"## {title}\n\n{what}\n\n```console\n"
        for line in filter(None, (f"faultgouge examples {name}", command, draws.format(name))):
            run = f"export OMP_NUM_THREADS=1 PATH={bin_folder}:{Path(sys.executable).parent}:$PATH; {line}"
            done = subprocess.run(["bash", "-c", run], cwd=empty, capture_output=True, text=True, check=False)
            if done.returncode:
                raise RuntimeError(f"the example {name}: {line}: {done.stderr}")
            text += f"$ {line}\n{lines_of(done.stdout)}\n"
        found = next((path for each in PICTURES if (path := Path(empty, each)).exists()), None)
        if found:
            (folder / f"{name}.png").write_bytes(found.read_bytes())
    text += "```\n\n" + (f"![{title}]({name}.png)\n\n" if found else "")
    language = {".in": "text", ".toml": "toml", ".csv": "text", ".py": "python"}[source.suffix]
    return text + f":::{{dropdown}} {source.name}\n```{language}\n{source.read_text()}```\n:::\n\n"


def make(folder: Path) -> None:
    """Write the page and its pictures into a folder."""
    folder.mkdir(exist_ok=True)
    head = """\
        # Gallery

        Ten examples, as they ran when these pages were built. `faultgouge examples` lists them, and each takes some
        seconds.

        """
    page = "".join(section(name, folder) for name in SHOWN)
    (folder / "index.md").write_text(dedent(head) + page)


if __name__ == "__main__":
    make(HERE / "auto_gallery")
