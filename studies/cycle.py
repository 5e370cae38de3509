r"""Eigenvalues of the states of a driven run: complex pairs, growth with and without dissipation, and folds.

The spring k draws the n disks of the upper layer, and its far end stands still for a small motion:

.. math:: K \to K + \frac{k}{n}\, \mathbf e \mathbf e^T, \qquad \mathbf e = 1 \text{ on x of the layer, 0 elsewhere.}

Two instabilities may begin a slip. **Growth**: a complex pair without dissipation, or Re s > 0 with dissipation.
**Fold**: a real eigenvalue of K, with contacts at Coulomb's bound that slide on, goes through zero, and the branch of
equilibria ends there (J. R. Rice, A. L. Ruina, J. Appl. Mech. 50, 343, 1983, have the same two of a spring and a
slider). Contacts at the bound are neither all sliding nor all sticking
(:mod:`~faultgouge.analysis.operators.sliders`): each number is given for both.

**Loose disks.** A disk that is about to leave its last contact has an eigenvalue near zero, of either sign, that says
nothing of the layer. Motions that only one disk takes part in are counted aside (`alone`). They do not count in the
rates and in the lowest eigenvalue.

**A state of a moving layer** is no equilibrium: its numbers are those of its positions and slips. The flag `rests`
says which states are equilibria.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ..analysis import Configuration, Packing, RunFile
from ..analysis.arrays import Complexes, Floats, derive_frozen
from ..analysis.counted import counted
from ..analysis.files.atomic_write import (
    FORMAT_KEY,
    check_format,
    check_own,
    make_folder,
    read_plain,
    read_plain_text,
    write_json,
)
from ..analysis.has_configuration import HasConfiguration
from ..analysis.motion.eigenvalues import SAFETY, growing_undamped, in_balance, unit_rounding, zero_uncertainties
from ..analysis.motion.linear import all_rates, linear_verdict
from ..analysis.motion.modes import Modes, participation_ratio
from ..analysis.motion.motion import Motion
from ..analysis.responses.slips import Slip
from ..analysis.table_display import table_of
from ..pywrap import SceneError
from ..pywrap.runs.drive import SERIES, drive_of, slips_in
from .result_rows import write_csv
from .study import Progress, Say, draw_all

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONE_PARTICIPATION = 1.5
"""Disks that take part in a motion, below which the motion is that of one disk."""

ALL_RATES = 1500
"""Coordinates up to which LAPACK computes all eigenvalues with dissipation, ten seconds: the fastest growing motion
alone, which is known of more coordinates, may be that of one disk."""

INVERSE_STEPS = 3
"""Steps of inverse iteration with an eigenvalue that is known to nine digits: two leave 1e-12 of the others."""


LINEAR_UP_TO = 1.0
"""Rates and eigenvalues up to which the axes are linear; beyond, they are logarithmic."""


class LinearState(NamedTuple):
    """Linear motion about a state, with all contacts at Coulomb's bound sticking, or all sliding.

    Attributes
    ----------
    pairs : int
        Complex pairs of K without dissipation.
    undamped : float
        Growth rate of D without dissipation, 1 / time: of complex pairs and of negative eigenvalues.
    damped : float, optional
        Largest 2 Re s with dissipation, 1 / time; None if no motion of several disks is known.
    lowest : float
        Least real part of the eigenvalues of K, 1 / time^2.
    alone : int
        Motions of one disk that grow without dissipation. The other numbers leave out the motions of one disk.
    """

    pairs: int
    undamped: float
    damped: float | None
    lowest: float
    alone: int


def with_spring(packing: HasConfiguration, spring: float) -> Configuration:
    """A state of a driven run with the stiffness of the spring, force / length on each disk of the layer."""
    return derive_frozen(packing.configuration, spring=spring)


def cycle_state(packing: Packing, spring: float, lone: float = LONE_PARTICIPATION) -> dict[str, Any]:
    """Numbers of one state of a driven run.

    Parameters
    ----------
    packing : Packing
        The state.
    spring : float
        Stiffness of the spring, force / length on each disk of the layer.
    lone : float
        Disks that take part in a motion, below which the motion is that of one disk.

    Returns
    -------
    dict
        rests (whether forces balance), residual (the largest on a disk over the largest normal force), at_bound
        (contacts at Coulomb's bound), and of `LinearState` NAME_sticking and NAME_sliding. A smoothed law has one
        derivative at the bound, and the two are the same.
    """
    configuration = with_spring(packing, spring)
    sticking = linear_state(configuration, False, lone)
    both = configuration.contacts.one_sided.any()
    sliding = linear_state(configuration, True, lone) if both else sticking
    return {
        "rests": bool(in_balance(configuration)),
        "residual": float(configuration.residual / configuration.normal_force.max(initial=np.finfo(float).tiny)),
        "at_bound": int(configuration.contacts.at_bound.sum()),
        **{f"{name}_sticking": value for name, value in sticking._asdict().items()},
        **{f"{name}_sliding": value for name, value in sliding._asdict().items()},
    }


def linear_state(configuration: Configuration, sliding: bool, lone: float = LONE_PARTICIPATION) -> LinearState:
    """The growth rates of linear motion about a configuration."""
    motion = Motion.of(configuration, sliding=sliding)
    modes = Modes.of_matrix(motion.stiffness)
    rounding = unit_rounding(motion.stiffness.data)
    zero = zero_uncertainties(configuration, rounding, motion.particle, modes.left, modes.right)
    values = modes.values
    complex_, negative = growing_undamped(values, modes.overlap, rounding, zero)
    shared = _disks(motion, modes.right) >= lone
    grows = (complex_ | negative) & shared
    rates = 2 * np.abs(np.sqrt(values[grows].astype(complex)).imag)
    return LinearState(
        pairs=int(np.count_nonzero(complex_ & shared)) // 2,
        undamped=float(rates.max(initial=0.0)),
        damped=_damped_rate(motion, lone),
        lowest=float(values[shared & (np.abs(values) > zero)].real.min(initial=np.inf)),
        alone=int(np.count_nonzero((complex_ | negative) & ~shared)),
    )


def _damped_rate(motion: Motion, lone: float) -> float | None:
    """Largest 2 Re s of the motions that more than one disk takes part in; None if no such motion is known."""
    stiffness, damping = motion.stiffness.toarray(), motion.damping.toarray()
    # LAPACK's, the fastest growing first; of a large packing the fastest alone
    large = len(motion.active) > ALL_RATES
    for s in [linear_verdict(motion, decides=False).s] if large else all_rates(motion)[0]:
        pencil = s * s * np.eye(len(stiffness)) + s * damping + stiffness
        if _disks(motion, null_vector(pencil)[:, None])[0] >= lone:
            return float(2 * s.real)
    return None


def null_vector(singular: Complexes) -> Complexes:
    """The vector that a matrix takes to zero but for rounding, by inverse iteration.

    A shift by some roundings keeps the pivots of a matrix that is exactly singular from being zero.
    """
    shift = SAFETY * unit_rounding(singular) * np.eye(len(singular))
    factors = lu_factor(singular + shift, check_finite=False)
    vector = np.random.Generator(np.random.PCG64(0)).standard_normal(len(singular)).astype(complex)
    for _ in range(INVERSE_STEPS):
        vector = lu_solve(factors, vector, check_finite=False)
        vector /= np.linalg.norm(vector)
    return vector


def _disks(motion: Motion, right: Complexes | Floats) -> Floats:
    """How many disks take part in each motion, from vectors of the active coordinates in columns."""
    whole = np.zeros((motion.configuration.coordinates, right.shape[1]), dtype=np.complex128)
    whole[motion.active] = right
    return len(motion.configuration) * participation_ratio(whole, motion.configuration.axes)


def draw_cycle_spectrum(
    series: Mapping[str, Floats], slips: Sequence[Slip], states: Sequence[Mapping[str, Any]]
) -> Figure:
    """Draw the force with its slips, and below the numbers of the states.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (S,)
        Columns time and force of a driven run.
    slips : sequence of Slip
        Its slips, each a band from its beginning to its end.
    states : sequence of mapping
        Rows of `cycle_state` with the key time; a state within a slip is a pale dot.
    """
    from matplotlib.figure import Figure

    from ..figures.series import draw_slips

    figure = Figure(figsize=(5.6, 6.2), layout="constrained")
    force, pairs, growth, lowest = panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.3, 1, 1.3, 1))
    draw_slips(panels, slips)
    for axes in panels:
        axes.margins(x=0)
    force.plot(series["time"], series["force"], color="C1", linewidth=0.8)
    force.set_ylabel("force $F$")
    force.margins(y=0.12)
    two = any(state["damped_sticking"] != state["damped_sliding"] for state in states)
    for branch, colour, damped in (("sticking", "C0", "C2"), ("sliding", "C3", "C3")):
        if branch == "sliding" and not two:
            continue
        words = f"all {branch}" if two else None
        beside = f", {words}" if two else ""
        _draw_states(pairs, states, f"pairs_{branch}", colour)
        if branch == "sticking":
            _draw_states(growth, states, "undamped_sticking", colour, f"without dissipation{beside}")
        _draw_states(growth, states, f"damped_{branch}", damped, f"with dissipation{beside}")
        _draw_states(lowest, states, f"lowest_{branch}", colour, words)
    pairs.set_ylabel("complex pairs")
    growth.set_ylabel("growth rate of $D$")
    lowest.set_ylabel("lowest eigenvalue")
    for axes in (growth, lowest):
        axes.set_yscale("symlog", linthresh=LINEAR_UP_TO)
        axes.axhline(0, color="0.5", linewidth=0.6)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=6, loc="best")
    lowest.set_xlabel("$t$")
    figure.align_ylabels()
    return figure


def _draw_states(
    axes: Axes, states: Sequence[Mapping[str, Any]], name: str, colour: str, label: str | None = None
) -> None:
    """A number of the states over time; dots of states within slips are pale."""
    time, value = (np.array([state[key] for state in states], dtype=float) for key in ("time", name))
    slipping = np.array([bool(state["slips"]) for state in states])
    axes.plot(time, value, color=colour, linewidth=0.6, alpha=0.6)
    axes.plot(time[~slipping], value[~slipping], ".", color=colour, markersize=3, label=label)
    axes.plot(time[slipping], value[slipping], ".", color=colour, markersize=3, alpha=0.3)


CYCLE_COLUMNS = (
    *("frame", "time", "force", "displacement", "slips", "rests", "residual", "at_bound"),
    *(f"{name}_{branch}" for branch in ("sticking", "sliding") for name in LinearState.__annotations__),
)

COLUMNS_BEFORE_SLIPS = {
    "time": "begins",
    "force": "F",
    "at_bound": "at the bound",
    "pairs_sticking": "pairs",
    "undamped_sticking": "undamped",
    "damped_sticking": "damped, stick",
    "damped_sliding": "damped, slide",
    "lowest_sticking": "lowest, stick",
    "lowest_sliding": "lowest, slide",
}
"""Columns of the table of states before slips, with their headings."""


def cycle(path: Path, output: Path, say: Say = print, progress: Progress = lambda rows, _: rows) -> list[str]:
    """Compute the eigenvalues of all states of a driven run, with the stiffness of its spring.

    Parameters
    ----------
    path : Path
        A drive.h5 that a spring has drawn.
    output : Path
        The folder: cycle.json and cycle.csv, which grow with each state, and the picture. States that cycle.json has of
        the same file are not computed again.
    say, progress
        As of :func:`~faultgouge.studies.sweep.run_sweep.run_sweep`.

    Returns
    -------
    list of str
        The states before the slips as a table, and what was written.

    Raises
    ------
    SceneError
        If the file is no drive.h5, or the layer of the run had no spring.
    """
    with RunFile(path) as file:
        settings = drive_of(file)
        if settings is None:
            raise SceneError(
                f"{path} is not a file of `faultgouge drive`: give such a file for the eigenvalues along its cycles, "
                "or a scene for those along a ramp"
            )
        if settings.spring == "rigid":
            raise SceneError(f"{path} is of a rigid drive, whose layer has no spring and no slips: draw with a spring")
        make_folder(output, "cycle.json")
        check_own(output / "cycle.csv", ",".join(CYCLE_COLUMNS))
        digest, known = hashlib.sha256(read_plain(path)).hexdigest(), output / "cycle.json"
        try:
            stored = json.loads(read_plain_text(known))
            check_format(stored.get(FORMAT_KEY), known)
            states = list(stored["states"]) if stored["sha256"] == digest else []
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            states = []
        spring, slips, times = float(settings.spring), slips_in(file), file.observable("time")
        series, displacement = file.series(SERIES), file.observable("displacement")
        result = {"file": path.name, "sha256": digest, "spring": spring, "slips": [asdict(slip) for slip in slips]}
        result["states"] = states
        for frame in progress(range(len(states), len(file)), len(file) - len(states)):
            packing, time = file.packing(frame), float(times[frame])
            where = {"frame": frame, "time": time, "force": packing.fx, "displacement": float(displacement[frame])}
            slipping = any(slip.begins < time <= slip.ends for slip in slips)
            states.append(where | {"slips": slipping} | cycle_state(packing, spring))
            write_json(known, result)
            write_csv(output / "cycle.csv", CYCLE_COLUMNS, states)
    draw_all({"cycle": lambda: draw_cycle_spectrum(series, slips, states)}, output, say)
    rows = []
    for number, slip in enumerate(slips, 1):
        before = [state for state in states if state["time"] <= slip.begins][-1]
        cells = ("" if before[name] is None else f"{before[name]:.4g}" for name in COLUMNS_BEFORE_SLIPS)
        rows.append([str(number), *cells])
    says = [table_of(("slip", *COLUMNS_BEFORE_SLIPS.values()), rows)] if rows else []
    moving = sum(not state["rests"] for state in states)
    return [
        *says,
        f"{counted(len(states), 'state')}, {moving} of them not in equilibrium (the flag rests), "
        f"{counted(len(rows), 'slip')}; written: {output}/cycle.json, cycle.csv, cycle.png",
    ]
