"""What a first answer costs, from the start of Python: `python benchmarks/first_answer.py [--fast]`."""

import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from subprocess import PIPE

HEAD = """## The first answer

The scene of README, 100 disks: commands from the start of Python. Most of the imports are NumPy, SciPy, MPI and
pydantic; `python -X importtime -m faultgouge onset scene.toml` lists them. Medians of {turns}.

| | processor, s | first line after, s |
|---|---|---|"""

README = Path(__file__).parents[1] / "README.md"

PARTS = """
import time
from pathlib import Path
import faultgouge.commands.onset
from faultgouge.pywrap import Scene, settle
from faultgouge import onset

imports = time.process_time()
scene = Scene.from_toml(Path("scene.toml"))
settle(scene)
settling = time.process_time()
onset(scene)
ends = 0.0, imports, settling, time.process_time()
print(*(later - sooner for sooner, later in zip(ends, ends[1:])))
"""

COMMANDS = (
    "onset scene.toml",
    "settle scene.toml -o settled.h5",
    "stability run.h5",
    "spectrum run.h5 --frame 10",
    "explain scene.toml",
    "--help",
)


def run(folder: Path, *words: str) -> tuple[str, float, float]:
    """The output of a Python in a folder, the seconds to its first line, and those of the processor."""
    begin, before = time.time(), processor_seconds()
    with subprocess.Popen([sys.executable, *words], cwd=folder, stdout=PIPE, stderr=PIPE) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        first = time.time() - begin
        said, error = process.communicate()
    if process.returncode:
        sys.exit(error.decode())
    return (line + said).decode(), first, processor_seconds() - before


def processor_seconds() -> float:
    """Seconds of the processor of all processes that this one has started, and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print the section."""
    turns = 1 if "--fast" in sys.argv else 5
    (scene,) = re.findall(r"```toml\n(# scene.toml\n.*?)```", README.read_text(), re.DOTALL)
    parts, times = [], {command: [] for command in COMMANDS}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(scene)
        run(folder, "-m", "faultgouge", "ramp", "scene.toml", "-o", "run.h5")
        for _ in range(turns):
            parts.append([float(word) for word in run(folder, "-c", PARTS)[0].split()])
            for command in COMMANDS:
                times[command].append(run(folder, "-m", "faultgouge", *command.split())[1:])
                (folder / "settled.h5").unlink(missing_ok=True)
    print(HEAD.format(turns=turns))
    for label, seconds in zip(("imports", "settling", "settling and onset"), zip(*parts, strict=True), strict=True):
        print(f"| {label} | {statistics.median(seconds):.2f} | |")
    for command, both in times.items():
        first, processor = (statistics.median(each) for each in zip(*both, strict=True))
        print(f"| `faultgouge {command}` | {processor:.2f} | {first:.2f} |")


if __name__ == "__main__":
    main()
