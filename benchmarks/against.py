"""Two versions of the package, one beside the other: assembly of K, an increment of F_x, and an onset.

A change that makes things easier to read must not make them slower. The versions take turns, a process each, so that
what else the machine does falls on both alike; times are those of the processor, with one thread. For the reference
packing of 100 disks:

    assembly    `stiffness_matrix`, in microseconds, of the least of some repetitions
    increment   an equilibrium from the one before by Newton's method, in milliseconds, the median of 200
    onset       `find_onset` along the ramp to F_x = 0.0225 in increments of 1e-3, ramp included, in seconds
    large       the same of a packing of 320 disks, whose spectrum comes in slices

Medians over the rounds, and the ratio of the two. The other tree needs its plugin in `src/faultgouge/lib`, and in
`src/faultgouge` the links to its folders.

    python benchmarks/against.py OTHER_TREE [--rounds 7] [--only assembly increment onset large]
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import statistics
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parents[1]
PACKING = HERE / "tests" / "reference" / "packing7.json"
LAW = {"law": {"kn": 2e5, "mu": 1.0}, "load": {"fy": 3.0}}


def assembly() -> float:
    """Microseconds."""
    from faultgouge.analysis import stiffness_matrix
    from faultgouge.pywrap import Scene, settle

    packing = settle(Scene.from_mapping({"packing": {"file": str(PACKING)}} | LAW)).packing
    return 1e4 * min(timeit.repeat(lambda: stiffness_matrix(packing), timer=time.process_time, number=100, repeat=20))


def increment() -> float:
    """Milliseconds."""
    from faultgouge.pywrap import Engine, Scene, equilibrate, settle

    start, seconds = settle(Scene.from_mapping({"packing": {"file": str(PACKING)}} | LAW)), []
    with Engine(start.packing) as engine:
        for _ in range(11):
            here = start
            for k in range(1, 21):
                begin = time.process_time()
                here = equilibrate(engine, here, k * 1e-3)
                seconds.append(time.process_time() - begin)
    return 1e3 * statistics.median(seconds[20:])  # the first ones load libraries and caches


def onset(packing: dict, ramp: dict) -> float:
    """Seconds of the second solution: the first one loads libraries."""
    from faultgouge.analysis import find_onset
    from faultgouge.pywrap import Engine, Scene, settle

    try:
        from faultgouge.pywrap.runs.equilibrium_path import EquilibriumPath, loads
    except ModuleNotFoundError:  # version 0.1.0
        from faultgouge.pywrap.stages import EquilibriumPath, loads

    scene = Scene.from_mapping({"packing": packing, "ramp": ramp} | LAW)
    start, seconds = settle(scene, 1.0), 0.0
    for _ in range(2):
        with Engine(start.packing) as engine:
            begin = time.process_time()
            path = EquilibriumPath(engine, start, scene)
            forces = loads(scene.ramp)
            for _ in path.climb(forces[1:]) if len(start.packing) <= 300 else ():
                pass
            find_onset(path, forces)
            seconds = time.process_time() - begin
    return seconds


WORK: dict[str, Callable[[], float]] = {
    "assembly": assembly,
    "increment": increment,
    "onset": lambda: onset({"file": str(PACKING)}, {"step": 1e-3, "until": 0.0225}),
    "large": lambda: onset({"disks": 320, "width": 21.3, "seed": 1}, {"step": 2 / 320, "until": 0.25}),
}


def measured(tree: Path, name: str) -> float:
    """One figure of one version, in a process of its own."""
    command = [sys.executable, __file__, str(tree), "--work", name]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(tree / "src")}, capture_output=True, text=True, check=True
    )
    return float(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tree", type=Path, help="the other version")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", nargs="+", choices=WORK, default=list(WORK))
    parser.add_argument("--work", choices=WORK, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        print(json.dumps(WORK[options.work]()))
        return
    print(f"{'':12s}{'there':>10s}{'here':>10s}{'ratio':>8s}")
    for name in options.only:
        pairs = [(measured(options.tree.resolve(), name), measured(HERE, name)) for _ in range(options.rounds)]
        there, here = (statistics.median(values) for values in zip(*pairs, strict=True))
        print(f"{name:12s}{there:10.4g}{here:10.4g}{here / there:8.3f}", flush=True)


if __name__ == "__main__":
    main()
