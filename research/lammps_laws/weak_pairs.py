r"""The weak complex pairs of mindlin/force followed in LAMMPS: does what the spectrum says of them hold?

With the right and left vectors x and y of an eigenvalue :math:`\lambda`, the coordinate :math:`c = y^H M^{1/2} q` of
small motion obeys :math:`\ddot c = -\lambda c`, so that

.. math:: \dot c = a e^{st} + b e^{-st}, \qquad s = i \sqrt\lambda, \qquad \mathrm{Re}\, s > 0 .

The part that grows turns in the complex plane against the part that decays. Averages over many periods, after the turn
of one of them is taken out, leave this one alone. Its amplitude tells the rate, long before the motion as a whole
grows.

A packing is let go without any dashpot with the velocities of x.
"""

import json
import time
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from faultgouge.analysis import Configuration, Floats, dynamical_matrix, spectrum
from faultgouge.pywrap import in_a_copy
from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
from research.lammps_laws.compute import MU, NONE, STEEP, STEP, TILTS, describe, pour, read, rest

LAW, D = "granular hertz, mindlin/force", 3


class Sample(NamedTuple):
    """Packings: particles, friction, tilts, and the last seed."""

    particles: int
    mu: float
    tilts: tuple[float, ...]
    seeds: int


SAMPLES = (Sample(200, MU, TILTS, 60), Sample(50, 0.9, STEEP, 160))
"""Every pair that is found is followed. The last seed of the first sample was set after its pair had been seen, that of
the second one by the hour: 40 seeds, which were to do, had no pair."""

DISPLACEMENTS = (3e-9, 3e-8)
"""Largest displacements of the mode that is set going: a thousandth and a hundredth of the smallest overlaps, and above
the 1e-10 of the bound by which a history must have left its plane before LAMMPS turns it."""

TIME, STEPS = 2000.0, 97
"""How long, and steps between two looks: five looks a period."""

WINDOWS, FIRST = 40, 8
"""Windows that the run is divided into, and the one from which on amplitudes are fitted: contacts at the bound slide a
little at first."""


def rows(sample: Sample, seed: int) -> list[dict[str, Any]]:
    """A packing at all tilts; the rates of its fastest pair by the spectrum and in LAMMPS where it has one."""
    found = []
    with TemporaryDirectory() as folder:
        lmp = pour(LAW, D, sample.particles, sample.mu, seed, Path(folder) / "log", NONE)
        for tilt in sample.tilts:
            begin = time.process_time()
            lmp.command(f"variable slope equal {tilt}")
            row: dict[str, Any] = {"count": sample.particles, "mu": sample.mu, "seed": seed, "tilt": tilt}
            row["rests"] = False
            snapshot = rest(lmp)
            if snapshot is not None:
                row |= {"rests": True} | {name: describe(snapshot)[name] for name in ("pairs", "at_bound", "residual")}
                row |= {"runs": [follow(lmp, snapshot, size) for size in DISPLACEMENTS]} if row["pairs"] else {}
            found.append(row | {"cpu_seconds": time.process_time() - begin})
            if snapshot is None:
                break
        lmp.close()
    return found


def follow(lmp: Any, snapshot: Configuration, displacement: float) -> dict[str, float]:
    """Rates of D of the fastest pair: "predicted", and "grows" and "decays" as its two parts do in LAMMPS."""
    (a, active), root = dynamical_matrix(snapshot), np.sqrt(snapshot.coordinate_mass)
    values, left, right = eig(a.toarray(), left=True)
    number = int(np.argmin(np.abs(values - spectrum(snapshot).pairs[0].eigenvalue)))
    s = 1j * np.sqrt(values[number])
    s = s if s.real > 0 else -s
    x = np.real(right[:, number] * np.exp(-0.5j * np.angle(np.sum(right[:, number] ** 2))))
    start = np.zeros(snapshot.coordinates)
    start[active] = displacement * abs(s) * x / np.abs(x).max() / root[active]
    velocities = in_a_copy(lambda: _run(lmp, snapshot, start))
    coordinate = (velocities * root)[:, active] @ left[:, number].conj()
    times = STEPS * STEP * np.arange(1, len(coordinate) + 1, dtype=np.float64)
    grows, decays = (_rate(times, coordinate * np.exp(-1j * turn * times)) for turn in (s.imag, -s.imag))
    return {"displacement": displacement, "predicted": 2 * float(s.real), "grows": grows, "decays": decays}


def _run(lmp: Any, snapshot: Configuration, start: Floats) -> Floats:
    """Velocities of all coordinates at every look, without drag."""
    lmp.commands_list(["log none", "unfix drag", "unfix spin", f"timestep {STEP}"])
    set_velocity(lmp, snapshot, start)
    looks = []
    for _ in range(round(TIME / (STEPS * STEP))):
        lmp.command(f"run {STEPS} post no")
        order = rows_of(lmp, snapshot)
        rotation = owned_array(lmp, "omega")[order] * snapshot.radius[:, None]
        looks.append(snapshot.join_vectors(owned_array(lmp, "v")[order], rotation))
    return np.array(looks)


def _rate(times: Floats, part: NDArray[np.complex128]) -> float:
    """Twice the rate of the slow part of a coordinate."""
    windows = np.array_split(np.arange(len(times)), WINDOWS)
    size = [np.abs(np.average(part[each], weights=np.hanning(len(each)))) for each in windows]
    middle = [times[each].mean() for each in windows]
    return 2 * float(np.polyfit(middle[FIRST:], np.log(size[FIRST:]), 1)[0])


def compute_weak(table: Path, samples: Iterable[Sample] = SAMPLES, watch: Any = print) -> None:
    """Add the packings that a table lacks."""
    known = {(row["count"], row["mu"], row["seed"]) for row in read(table)}
    for sample, seed in ((each, seed) for each in samples for seed in range(1, each.seeds + 1)):
        if (sample.particles, sample.mu, seed) not in known:
            made = rows(sample, seed)
            with table.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in made)
            watch(made, flush=True)
