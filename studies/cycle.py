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
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import svd

from ..analysis import Configuration, Packing, RunFile
from ..analysis.arrays import Complexes, Floats, derive_frozen
from ..analysis.counted import counted
from ..analysis.files.atomic_write import check_own, make_folder, read_plain, write_json
from ..analysis.has_configuration import HasConfiguration
from ..analysis.motion.eigenvalues import growing_undamped, in_balance, unit_rounding, zero_uncertainties
from ..analysis.motion.linear import all_rates
from ..analysis.motion.modes import Modes, participation_ratio
from ..analysis.motion.motion import Motion
from ..analysis.responses.slips import Slip
from ..analysis.table_display import table_of
from ..pywrap import SceneError
from ..pywrap.runs.drive import SERIES, drive_of, slips_in
from .result_rows import Rows, write_csv
from .study import Progress, Say, draw_all

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONE_PARTICIPATION = 1.5
"""Disks that take part in a motion, below which the motion is that of one disk."""

STATE = ("pairs", "undamped", "damped", "lowest", "alone")
"""Numbers of a state, with all contacts at Coulomb's bound sticking, or all sliding: see `linear_state`."""


def with_spring(packing: HasConfiguration, spring: float) -> Configuration:
    """A state of a driven run with the stiffness of the spring, force / length on each disk of the layer."""
    return derive_frozen(packing.configuration, spring=spring)


def cycle_state(packing: Packing, spring: float, lone: float = LONE_PARTICIPATION) -> dict[str, Any]:
    """Numbers of one state of a driven run, with the stiffness of the spring, force / length on each disk of the layer.

    rests: whether forces balance; residual: the largest on a disk over the largest normal force; at_bound: contacts at
    Coulomb's bound; NAME_sticking and NAME_sliding of `linear_state`. A smoothed law has one derivative at the bound,
    and the two are the same. With less than `lone` disks that take part in a motion, the motion is that of one disk.
    """
    configuration = with_spring(packing, spring)
    sticking = linear_state(configuration, False, lone)
    sliding = linear_state(configuration, True, lone) if configuration.contacts.one_sided.any() else sticking
    return {
        "rests": bool(in_balance(configuration)),
        "residual": float(configuration.residual / configuration.normal_force.max(initial=np.finfo(float).tiny)),
        "at_bound": int(configuration.contacts.at_bound.sum()),
        **{f"{name}_sticking": value for name, value in sticking.items()},
        **{f"{name}_sliding": value for name, value in sliding.items()},
    }


def linear_state(configuration: Configuration, sliding: bool, lone: float = LONE_PARTICIPATION) -> dict[str, Any]:
    """Linear motion about a state, with all contacts at Coulomb's bound sticking, or all sliding.

    pairs: complex pairs of K without dissipation; undamped: growth rate of D without dissipation, 1 / time, of complex
    pairs and of negative eigenvalues; damped: largest 2 Re s with dissipation, 1 / time, None if no motion of several
    disks is known; lowest: least real part of the eigenvalues of K, 1 / time^2; alone: motions of one disk that grow
    without dissipation. The other numbers leave out the motions of one disk.
    """
    motion = Motion.of(configuration, sliding=sliding)
    modes = Modes.of_matrix(motion.stiffness)
    rounding = unit_rounding(motion.stiffness.data)
    zero = zero_uncertainties(configuration, rounding, motion.particle, modes.left, modes.right)
    values = modes.values
    complex_, negative = growing_undamped(values, modes.overlap, rounding, zero)

    def shares(right: Complexes | Floats) -> Any:
        """Whether more than one disk takes part in motions, vectors of the active coordinates in columns."""
        whole = np.zeros((configuration.coordinates, right.shape[1]), dtype=np.complex128)
        whole[motion.active] = right
        return len(configuration) * participation_ratio(whole, configuration.axes) >= lone

    shared = shares(modes.right)
    rates = 2 * np.abs(np.sqrt(values[(complex_ | negative) & shared].astype(complex)).imag)
    stiffness, damping = motion.stiffness.toarray(), motion.damping.toarray()
    # the fastest growing first; its vector is what the pencil takes to zero but for rounding
    pencils = ((s, s * s * np.eye(len(stiffness)) + s * damping + stiffness) for s in all_rates(motion)[0])
    damped = next((2 * float(s.real) for s, pencil in pencils if shares(svd(pencil)[2][-1:].conj().T)[0]), None)
    lowest = values[shared & (np.abs(values) > zero)].real.min(initial=np.inf)
    pairs, alone = np.count_nonzero(complex_ & shared) // 2, np.count_nonzero((complex_ | negative) & ~shared)
    numbers = (int(pairs), float(rates.max(initial=0.0)), damped, float(lowest), int(alone))
    return dict(zip(STATE, numbers, strict=True))


def draw_cycle_spectrum(
    series: Mapping[str, Floats], slips: Sequence[Slip], states: Sequence[Mapping[str, Any]]
) -> Figure:
    """Draw the force over time of a driven run, its slips as bands, and below the numbers of the states, rows of
    `cycle_state` with the key time; a state within a slip is a pale dot."""
    from matplotlib.figure import Figure

    from ..figures.series import draw_slips

    figure = Figure(figsize=(5.6, 6.2), layout="constrained")
    force, *others = panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.3, 1, 1.3, 1))
    draw_slips(panels, slips)
    force.plot(series["time"], series["force"], color="C1", linewidth=0.8)
    force.set_ylabel("force $F$")
    time, slipping = (np.array([state[name] for state in states]) for name in ("time", "slips"))
    for axes, (label, names) in zip(others, DRAWN.items(), strict=True):
        for colour, (name, words) in zip(("C0", "C2", "C3"), names.items(), strict=False):
            value = np.array([state[name] for state in states], dtype=float)
            axes.plot(time, value, color=colour, linewidth=0.6, alpha=0.6)
            axes.plot(time[~slipping], value[~slipping], ".", color=colour, markersize=3, label=words)
            axes.plot(time[slipping], value[slipping], ".", color=colour, markersize=3, alpha=0.3)
        axes.set_ylabel(label)
        axes.legend(fontsize=6, loc="best")
        if axes is not others[0]:
            axes.set_yscale("symlog", linthresh=1.0)
            axes.axhline(0, color="0.5", linewidth=0.6)
    for axes in panels:
        axes.margins(x=0)
    force.margins(x=0, y=0.12)
    panels[-1].set_xlabel("$t$")
    figure.align_ylabels()
    return figure


UNDAMPED = {"undamped_sticking": "undamped"}
DRAWN = {
    "complex pairs": {"pairs_sticking": "all sticking", "pairs_sliding": "all sliding"},
    "growth rate of $D$": UNDAMPED | {"damped_sticking": "damped", "damped_sliding": "damped, sliding"},
    "lowest eigenvalue": {"lowest_sticking": "all sticking", "lowest_sliding": "all sliding"},
}
"""Numbers of states that the panels below the force show."""

CYCLE_COLUMNS = (
    *("frame", "time", "force", "displacement", "slips", "rests", "residual", "at_bound"),
    *(f"{name}_{branch}" for branch in ("sticking", "sliding") for name in STATE),
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

    `path` is a drive.h5 that a spring has drawn. The folder `output` gets cycle.jsonl, which grows with each state, so
    that states of the same file are not computed again; cycle.json, cycle.csv and the picture. Returns the states
    before the slips as a table, and what was written. Raises SceneError if the file is no drive.h5, or the layer of the
    run had no spring.
    """
    with RunFile(path) as file:
        settings = drive_of(file)
        if settings is None:
            cure = "give such a file for the eigenvalues along its cycles, or a scene for those along a ramp"
            raise SceneError(f"{path} is not a file of `faultgouge drive`: {cure}")
        if settings.spring == "rigid":
            raise SceneError(f"{path} is of a rigid drive, whose layer has no spring and no slips: draw with a spring")
        make_folder(output, "cycle.json")
        check_own(output / "cycle.csv", ",".join(CYCLE_COLUMNS))
        digest = hashlib.sha256(read_plain(path)).hexdigest()
        rows, spring, slips = Rows(output / "cycle.jsonl", digest[:12]), float(settings.spring), slips_in(file)[0]
        series, times, displacement = file.series(SERIES), file.observable("time"), file.observable("displacement")
        missing = [frame for frame in range(len(file)) if rows.find(frame=frame) is None]
        for frame in progress(missing, len(missing)):
            packing, time = file.packing(frame), float(times[frame])
            where = {"frame": frame, "time": time, "force": packing.fx, "displacement": float(displacement[frame])}
            slipping = any(slip.begins < time <= slip.ends for slip in slips)
            rows.append(**where, slips=slipping, **cycle_state(packing, spring))
    states = [{key: row[key] for key in row if key not in ("scene", "version")} for row in rows.rows]
    result = {"file": path.name, "sha256": digest, "spring": spring, "slips": [asdict(slip) for slip in slips]}
    write_json(output / "cycle.json", result | {"states": states})
    write_csv(output / "cycle.csv", CYCLE_COLUMNS, states)
    draw_all({"cycle": lambda: draw_cycle_spectrum(series, slips, states)}, output, say)
    before = [[state for state in states if state["time"] <= slip.begins][-1] for slip in slips]
    cells = [["" if row[name] is None else f"{row[name]:.4g}" for name in COLUMNS_BEFORE_SLIPS] for row in before]
    table = [[str(number), *row] for number, row in enumerate(cells, 1)]
    moving = sum(not state["rests"] for state in states)
    return [
        *([table_of(("slip", *COLUMNS_BEFORE_SLIPS.values()), table)] if table else []),
        f"{counted(len(states), 'state')}, {moving} of them not in equilibrium (the flag rests), "
        f"{counted(len(table), 'slip')}; written: {output}/cycle.json, cycle.csv, cycle.png",
    ]
