"""How settling, an increment of the load and the onset grow with the packing: `python benchmarks/scale.py [--fast]`.

Square packings of disks of two radii, width 1.192 sqrt(N), with the upper layer of a scene that does not say `top`.
Each size runs in a process of its own.
"""

import math
import multiprocessing
import resource
import statistics
import sys
import time

from faultgouge import onset
from faultgouge.pywrap import Engine, Scene, equilibrate, settle

HEAD = """## Growth with size

From a loose start to rest at F_x = 0; one increment of F_x by 2/N by Newton's method, the median of three; and all of
`onset`, from the loose start to the first window. Memory is that of settling and increments. The exponents are those
between the smallest and the largest size.

| disks | settle, s | increment, s | memory, GB | onset, s | F_x^c |
|---|---|---|---|---|---|"""

INCREMENTS = 50
"""Number of increments, each of 2/N: the first onset falls somewhat faster than 2/N, and contacts change as often in an
increment."""

LARGEST_ONSET = 3000
"""Disks of which the onset is sought: 10,000 take two minutes or more."""


def scene(disks: int) -> Scene:
    """A square packing of so many disks."""
    packing = {"disks": disks, "width": round(1.192 * math.sqrt(disks), 1), "seed": 1}
    ramp = {"step": 2 / disks, "until": 2 * INCREMENTS / disks}
    return Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": ramp})


def measured(disks: int) -> list[float]:
    """The row of one size."""
    clock, increments = time.process_time, []
    begin = clock()
    here = settle(scene(disks))
    settling = clock() - begin
    with Engine(here.packing) as engine:
        for k in range(1, 4):
            begin = clock()
            here = equilibrate(engine, here, 2 * k / disks)
            increments.append(clock() - begin)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    row = [settling, statistics.median(increments), memory]
    if disks <= LARGEST_ONSET:
        begin = clock()
        found = onset(scene(disks))
        row += [clock() - begin, found.fx_c]
    return row


def main() -> None:
    """Print the section."""
    print(HEAD, flush=True)
    rows = {}
    for disks in (100, 300) if "--fast" in sys.argv else (1000, 3000, 10_000):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows[disks] = pool.apply(measured, (disks,))
        print(f"| {disks} | {' | '.join(f'{value:.3g}' for value in rows[disks])} |", flush=True)
    (few, small), *_, (many, large) = rows.items()
    settling, increment = (math.log(large[k] / small[k]) / math.log(many / few) for k in (0, 1))
    print(f"| exponent | {settling:.2f} | {increment:.2f} |")


if __name__ == "__main__":
    main()
