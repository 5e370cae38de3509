r"""Complex pairs along a ramp: their number, their growth rates, and the loss that stops them.

Beyond the first window the operator :math:`K = S + A` of a packing, S symmetric and A antisymmetric, has ever more
complex pairs. With :math:`\omega = \sqrt\lambda`, the mean square displacement of a pair grows at the rate
:math:`2 |\mathrm{Im}\,\omega|`, and

.. math:: Q = \frac{|\mathrm{Re}\,\omega|}{2\,|\mathrm{Im}\,\omega|}

is the quality factor below which a dissipation that gives each mode the loss :math:`\omega/Q` stops the growth. The
least Q over the pairs of a load is the Q that stops all of them. The *share* of complex modes is twice the number of
pairs over the number of eigenvalues; rattlers have none.

**Which pairs count.** For eigenvalues that nearly merge, rounding makes spurious pairs with imaginary parts of up to
:math:`(u |A|_F\, c)^{1/2}` for couplings c (:mod:`~faultgouge.analysis.motion.spectrum`). No coupling is larger than
the largest eigenvalue, so that a pair beyond that bound is physical, and its vectors are not needed. For the other
pairs the vectors are computed, and decide.

**Where the branch ends.** A real negative eigenvalue is the classical instability: Newton's method has passed a turning
point, and no packing reaches such an equilibrium by itself. The loads of a packing end before this point ("turning
point").

**A bound.** The imaginary part of an eigenvalue is at most the norm of the antisymmetric part, :math:`|\mathrm{Im}\,
\lambda| \le |(A - A^T)/2|_2` with A the mass-weighted operator (Bendixson, Acta Math. 25, 359 (1902)): the key bound. A
contact couples only two disks, so that the norm does not grow with the number of disks unless contacts become stiffer
or more loaded: growth rates cannot grow without limit with the number of disks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from ..analysis import (
    NoEquilibriumError,
    Packing,
    dynamical_matrix,
    eigenvalues,
    growth_rate,
    nearest_modes,
    negative_eigenvalues,
    spectrum,
)
from ..analysis.files.atomic_write import write_json
from ..analysis.motion.eigenvalues import SAFETY, Complexes, exceeds_rounding, unit_rounding
from ..analysis.motion.spectrum import SLICED
from ..analysis.table_display import table_of
from ..pywrap import Equilibrium, Scene
from ..pywrap.scenes.command_sections import PATH, section_of
from ..pywrap.scenes.validation import Positive, Section, require_section
from .cycle import cycle
from .packing_tools import Start, path_from
from .result_rows import Row, write_csv
from .statistics import median
from .study import Say, draw_all, task

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .sweep.sweep_plan import Sweep

SHIFT_OFFSET = 1e-9
"""Distance of a shift from the eigenvalue whose vectors are wanted, in units of the eigenvalue."""

NORM_ERROR = 1e-6
"""Relative error of the norm squared: it is a bound that is several times larger than what it bounds."""

FREQUENCY_DIGITS = 7
"""Digits of the frequencies that are stored."""

QUANTITIES = ("share", "growth_rate", "least_q")

ROCK = (50, 300)
"""Quality factors of rock."""

TICKS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""F_x/F_y that stand below an axis, where they were looked at."""

LABELS = {
    "share": "share of complex modes",
    "growth_rate": r"largest $2\,|\mathrm{Im}\,\omega|$",
    "least_q": "least Q",
    "critical_restitution": "critical restitution",
}

COLUMNS = ("disks", "seed", "fx", "fx_over_fy", "pairs", "share", "growth_rate", "omega", "least_q")
"""Of modes.csv."""

SHOWN = {"fx_over_fy": "g", "pairs": "d", "share": ".3f", "growth_rate": ".4g", "least_q": ".4g"}
"""Numbers of a load that a terminal shows, and their formats."""

MediansOverLoad = Mapping[str, Any]
"""loads, and for each quantity a list of [median, low, high]."""


class ModesSection(Section):
    """[modes] the complex pairs along the ramp.

    Attributes
    ----------
    fx_over_fy : tuple of float
        Loads at which all eigenvalues are taken, in units of F_y. Those beyond the last equilibrium are left out.
    """

    fx_over_fy: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)] = (
        *(0.003, 0.01, 0.02, 0.03, 0.05, 0.1, 0.14, 0.2, 0.25, 0.3, 0.35, 0.4),
    )


class PairCounts(NamedTuple):
    """The complex pairs of one packing: of each the frequency with positive real and imaginary part, fastest growing
    first, 1 / time; the number of eigenvalues; and the real negative ones, the most negative first, 1 / time^2."""

    omega: Complexes
    modes: int
    negative: tuple[float, ...] = ()

    @classmethod
    def of(cls, values: Complexes) -> PairCounts:
        """Pairs of some eigenvalues: all with a positive imaginary part count."""
        omega = np.sqrt(values[values.imag > 0])
        return cls(omega[np.argsort(-omega.imag)], len(values))

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers: pairs, negative, share, growth_rate, omega (of the fastest pair), least_q."""
        w, count = self.omega, len(self.omega)
        rates = [growth_rate(value) for value in self.negative[:1]] + [2 * each.imag for each in w[:1]]
        share = 2 * count / self.modes if self.modes else 0.0
        numbers = {"pairs": count, "share": share, "negative": len(self.negative)}
        fastest, least = (float(w[0].real), float(np.min(w.real / (2 * w.imag)))) if count else (None, None)
        return numbers | {"growth_rate": float(max(rates, default=0.0)), "omega": fastest, "least_q": least}


def count_pairs(packing: Packing) -> PairCounts:
    """The complex pairs of a packing in equilibrium that exceed their rounding uncertainty."""
    if packing.coordinates > SLICED:
        found = spectrum(packing)
        omega = np.sqrt([pair.eigenvalue for pair in found.pairs]).astype(np.complex128)
        return PairCounts(omega, len(found.eigenvalues), tuple(found.negative.tolist()))
    values = eigenvalues(packing).copy()
    rounding = unit_rounding(dynamical_matrix(packing)[0].data)
    surely = np.sqrt(SAFETY * rounding * np.abs(values).max(initial=0.0))
    for k in np.flatnonzero((values.imag > 0) & (values.imag <= surely)):  # the vectors decide
        near = nearest_modes(packing, values[k] * (1 + SHIFT_OFFSET), 2)
        nearest = int(np.argmin(np.abs(near.values - values[k])))
        if not exceeds_rounding(values[k], float(near.overlap[nearest]), rounding):
            values[k] = values[k].real
    return PairCounts.of(values)._replace(negative=tuple(negative_eigenvalues(packing).tolist()))


def antisymmetric_norm(packing: Packing) -> float:
    """|(A - A^T)/2|_2 of the mass-weighted operator, which no |Im lambda| exceeds, 1 / time^2."""
    matrix, _ = dynamical_matrix(packing)
    skew = csr_array(0.5 * (matrix - matrix.T))
    if skew.shape[0] < 3 or abs(skew).max() == 0:
        return 0.0
    start = np.random.default_rng(0).standard_normal(skew.shape[0])
    largest = eigsh(csr_array(skew.T @ skew), 1, which="LA", v0=start, tol=NORM_ERROR, return_eigenvectors=False)
    return float(np.sqrt(largest[0]))


def along_ramp(scene: Scene, rest: Equilibrium, look: Callable[[Packing], dict[str, Any]]) -> dict[str, Any]:
    """The row of a scene: `look`, packing -> the numbers of one load, at each load of [modes] that the packing bears,
    from the settled packing on."""
    wanted = sorted((section_of(scene, ModesSection) or ModesSection()).fx_over_fy)
    step = require_section(scene.ramp, "ramp").step
    row: dict[str, Any] = {"ends": "until", "loads": []}
    with path_from(rest, scene) as path:
        for share in wanted:
            fx = share * scene.load.fy
            try:  # by multiples of the step
                for k in range(round(path.equilibria[-1].fx / step), int(fx / step) + 1):
                    if path.equilibria[-1].fx < k * step < fx:
                        path(k * step)
                        del path.equilibria[:-2]  # thousands of equilibria of a large packing would fill the memory
                packing = path(fx)
            except NoEquilibriumError:
                row["ends"] = "no equilibrium"
                break
            if len(negative_eigenvalues(packing)):
                row["ends"] = "turning point"
                break
            row["loads"].append({"fx_over_fy": share, "fx": packing.fx} | look(packing))
    return row | {"reach": path.equilibria[-1].fx, "contacts": len(rest.packing.contacts)}


def load_row(packing: Packing) -> dict[str, Any]:
    """The numbers of one load of the task "modes"."""
    found = count_pairs(packing)
    row = found.as_dict() | {"modes": found.modes, "contacts": len(packing.contacts)}
    row |= {"sliding": int(np.count_nonzero(packing.sliding)), "rattlers": len(packing.rattlers)}
    row |= {"bound": antisymmetric_norm(packing)}
    if len(found.omega):
        value = found.omega[0] ** 2
        pair = nearest_modes(packing, value * (1 + SHIFT_OFFSET), 1)
        row |= {"participation": float(pair.participation[0]), "rotation": float(pair.rotation[0])}
    omegas = ((w.real, w.imag) for w in found.omega.tolist())
    return row | {"frequencies": [[float(f"{part:.{FREQUENCY_DIGITS}g}") for part in each] for each in omegas]}


def medians_over_load(rows: Sequence[Row], names: Sequence[str] = QUANTITIES) -> dict[str, Any]:
    """Medians with intervals at each load, and how many packings, a row each, bear it; least Q is inf of none."""
    every = [load for row in rows for load in row.get("loads", ())]
    loads = sorted({load["fx_over_fy"] for load in every})
    borne = [[load for load in every if load["fx_over_fy"] == each] for each in loads]
    found: dict[str, Any] = {"packings": len(rows), "loads": loads, "count": [len(each) for each in borne]}
    for name in names:
        found[name] = [median([np.inf if load[name] is None else load[name] for load in each]) for each in borne]
    return found


def over_load(courses: Mapping[str, MediansOverLoad], names: Sequence[str] = QUANTITIES) -> Figure:
    """Medians with their intervals over F_x/F_y, a panel for each quantity; what is written beside a line -> its
    numbers."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    from ..figures.style import INK

    figure = Figure((3.6 * len(names), 3.4), layout="constrained")
    seen = sorted({load for course in courses.values() for load in course["loads"]})
    ticks = [load for load in TICKS if load in seen]
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names, strict=True):
        for number, (label, course) in enumerate(courses.items()):
            draw_band(axes, course["loads"], np.array(course[name], dtype=float), f"C{number}", label)
        axes.set(xscale="log", xlabel=r"$F_x/F_y$", ylabel=LABELS[name])
        axes.set_xticks(ticks, [f"{load:g}" for load in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(0.8 * seen[0], 1.25 * seen[-1])  # also where no motion grows, and nothing is drawn
        if name in ("growth_rate", "least_q"):
            axes.set_yscale("log")
        if name == "least_q":
            axes.axhspan(*ROCK, color="0.9", zorder=0)
            axes.text(0.02, ROCK[0] * 1.1, "rock", transform=axes.get_yaxis_transform(), color=INK, fontsize="small")
        axes.grid(alpha=0.3)
    if len(courses) > 1:
        figure.axes[0].legend(title="disks")
    return figure


def draw_band(axes: Axes, loads: Sequence[float], values: Any, colour: str, label: str) -> None:
    """A line of medians with the band of their intervals; what is not positive is not drawn."""
    shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    axes.plot(loads, shown[:, 0], "o-", color=colour, label=label, markersize=3)
    axes.fill_between(loads, shown[:, 1], shown[:, 2], color=colour, alpha=0.2, linewidth=0)


def _gather(sweep: Sweep, rows: Sequence[Row], output: Path, say: Say) -> list[str]:
    """modes.json, modes.csv and a picture in the folder of a sweep; the loads of the first packing in words."""
    scenes = {point.key: point.scene for point in sweep.points}
    good, failed = ([row for row in rows if (row["says"] is None) is kind] for kind in (True, False))
    lines, packings, says = list[Row](), list[Row](), list[str]()
    for row in rows:
        scene, result = scenes[row["key"]], row["result"]
        packing = {} if scene is None else scene.packing.model_dump()
        known = {"disks": packing.get("disks"), "seed": packing.get("seed")}
        lines += [known | {key: load[key] for key in load if key != "frequencies"} for load in result.get("loads", ())]
        ends = {key: result.get(key) for key in ("ends", "reach", "contacts")}
        packings.append({"values": row["values"], "says": row["says"]} | ends)
    write_json(output / "modes.json", {"asked": sweep.as_dict(), "rows": lines, "packings": packings})
    write_csv(output / "modes.csv", COLUMNS, lines)
    if lines:
        groups: dict[str, list[Row]] = {}
        for row in good:
            groups.setdefault(str(row["values"].get("packing.disks")), []).append(row["result"])
        courses = {name: medians_over_load(group) for name, group in groups.items()}
        draw_all({"modes": lambda: over_load(courses)}, output, say)
        first = good[0]["result"]["loads"]
        table = [["" if load[k] is None else format(load[k], digits) for k, digits in SHOWN.items()] for load in first]
        says.append(table_of(("F_x/F_y", "complex pairs", "share", "growth rate of D", "least Q"), table))
    says.append(f"packings: {len(packings)}, failed: {len(failed)}; written: {output}/modes.json")
    says += [f"the first that failed: {row['says']}" for row in failed[:1]]
    if short := [row["result"] for row in good if row["result"]["ends"] != "until"]:
        why = "an eigenvalue is negative" if short[0]["ends"] == "turning point" else "there is no equilibrium"
        first_of = f"the first of them goes to F_x = {short[0]['reach']:g}, and {why} at the next load"
        left_out = "packings whose branch ends before the last load, so that loads are left out"
        says.append(f"{left_out}: {len(short)}; {first_of}")
    return says


@task(
    reads=PATH,
    needs=("ramp",),
    section=ModesSection,
    gather=_gather,
    writes={"modes.json": "", "modes.csv": ",".join(COLUMNS)},
    of_run=cycle,
    example="faultgouge examples modes && faultgouge modes modes.toml -o modes",
)
def modes(scene: Scene, start: Start) -> Row:
    """Compute the complex modes along the ramp: their number, growth rates, and the loss that would stop them.

    At each load of the section [modes] the command computes all eigenvalues: the
    share of complex modes, the largest growth rate, and the least Q, the quality
    factor below which dissipation stops all growth. It writes modes.json, modes.csv,
    and a picture over the load, of a sweep with medians over packings.

    Of a drive.h5 the command computes the eigenvalues of each stored state, with the
    stiffness of the spring: complex pairs, growth with and without dissipation, and
    the lowest eigenvalue, with the contacts at Coulomb's bound all sticking, and all
    sliding. It writes cycle.json, cycle.csv and a picture.
    """
    return along_ramp(scene, start(scene.law.mus[0]), load_row)
