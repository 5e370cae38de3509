"""``make fuzz``: scenes, damaged files and kills, at random.

    python -m fuzz [--scenes N] [--files N] [--kills N] [--seed S]

Prints what went wrong and how often; the exit code is 1 if something did.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

KINDS = {"scenes": 1000, "files": 300, "kills": 60}
"""Modules of this folder, each with ``run(count, folder, seed)``, and how many tries each makes by default."""


def try_kind(kind: str, count: int, seed: int) -> int:
    """Try one kind and say what goes wrong; the number of faults."""
    run: Callable[[int, Path, int], Iterator[tuple[str, str]]] = import_module(f".{kind}", __package__).run
    faults, tries, begin = 0, 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for what, says in run(count, Path(folder), seed):
            tries += 1
            if says:
                faults += 1
                print(f"{kind}: {what}: {says}", flush=True)
            elif sys.stderr.isatty():
                print(f"\r{kind}: {tries}", end="", file=sys.stderr, flush=True)
    print(f"{kind}: {tries} tries, {faults} faults, {time.monotonic() - begin:.0f} s", flush=True)
    return faults


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description="Scenes, damaged files and kills, at random.")
    for kind, count in KINDS.items():
        parser.add_argument(f"--{kind}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    chosen = vars(parser.parse_args())
    for library in ("OMP", "OPENBLAS"):  # a process with threads of BLAS is none to fork
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    return int(sum([try_kind(kind, chosen[kind], chosen["seed"]) for kind in KINDS if chosen[kind]]) > 0)


if __name__ == "__main__":
    sys.exit(main())
