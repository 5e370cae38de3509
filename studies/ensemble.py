r"""How generic is it? Onsets and eruptions over an ensemble of packings.

The members are the packings of one scene from the seeds s, s + 1, ...; nothing else differs. Each is settled and
ramped for every friction coefficient of the scene, and for :math:`\mu \mu_{ss}`, what friction weakens to (without
[friction] in the scene the last coefficient takes its place). Up to the first window of complex eigenvalues a ramp ends
in one of three ways: with an *onset*; *until* the scene's last F_x without one; or with a packing that *flows*, because
no equilibrium follows the last. The two latter say that the onset, if there is one, lies beyond the last equilibrium:
they are right-censored observations, and distributions of F_x^c are those of Kaplan and Meier, in which such a packing
counts up to where it was seen. (That a packing that begins to flow is like the others is an assumption; how many there
are is given with the result.)

Weakening lowers the onset where :math:`F_x^c(\mu \mu_{ss}) < F_x^c(\mu)`, and that can be known although one of the
two is censored. Where both are known and leave a window between them, three undamped runs from its middle tell whether
the packing erupts (:mod:`~faultgouge.studies.triggering`): unperturbed, perturbed, perturbed with mu(v). The *rise* is
the distance in decades between the largest D of the last two.

A rise alone is no instability. As soon as mu(v) has fallen, every contact that carries tangential load carries less of
it, and the equilibrium is elsewhere: D *jumps* to the square of that distance, in a packing that is stable with the
weakened friction as well. How far, a *control* shows: mu(v) at a force as far below the lower onset as the middle of
the window is above it. What tells an instability from the jump is that D goes on to *grow* after it, at the rate that
the spectrum has there with the weakened friction, until it levels off. The pair may also be real again at
the middle of the window, or grow too slowly for the length of the run; so the rate is kept beside all this.

Shares are given with Wilson's 95 % interval.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpi4py import MPI
from mpi4py.futures import MPICommExecutor, MPIPoolExecutor
from numpy.typing import NDArray
from scipy.stats import CensoredData, binomtest, ecdf
from threadpoolctl import threadpool_limits

from ..analysis import OnsetError, Packing, find_onset, spectrum
from ..pywrap import Engine, Equilibrium, Sample, Scene, SceneError
from ..pywrap.engine import Weakening
from ..pywrap.quasistatic import NoEquilibriumError
from ..pywrap.scene import Friction, GeneratedPacking, Perturb
from ..pywrap.stages import EquilibriumPath, loads, next_equilibrium, perturb, settle, weakening_of
from .figures import INK, STYLE, save
from .triggering import GROWTH_FACTOR, column, jump

Floats = NDArray[np.float64]
Say = Callable[[str], None]

FINEST_STEP = 1e-3
"""Increment of F_x below which a ramp only costs: onsets are solved for, and come out the same."""

LONGEST_TIME = 200.0
"""Length of the undamped runs, time, at the most: with 100 disks, four of them take some 30 s."""

RISES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""


@dataclass(frozen=True)
class RampEnd:
    """What a ramp of one packing met first.

    Attributes
    ----------
    mu : float
        Friction coefficient.
    ends : {"onset", "until", "flows"}
        A window of complex eigenvalues; the last F_x of the scene; no equilibrium beyond `reach`.
    reach : float
        Largest F_x up to which there is no window, force per disk of the upper layer: the onset, if there is one.
    error : float or None
        Uncertainty of the onset.
    """

    mu: float
    ends: Literal["onset", "until", "flows"]
    reach: float
    error: float | None = None

    @property
    def fx_c(self) -> float | None:
        """The onset, if there is one."""
        return self.reach if self.ends == "onset" else None


@dataclass(frozen=True)
class Eruption:
    """The runs from the middle of the window and the control, in numbers.

    Attributes
    ----------
    fx, fx_control : float
        The middle of the window, and the control below it, force per disk of the upper layer.
    rate : float
        Growth rate of D with the weakened friction at fx, from the spectrum, 1 / time; 0 if it is stable.
    unperturbed, perturbed, weakening, control : float
        Largest D, length^2: of the three runs at fx, and with mu(v) at fx_control.
    jump : float
        Largest D of the run with mu(v) in its first part, `JUMP_SHARE`.
    """

    fx: float
    fx_control: float
    rate: float
    unperturbed: float
    perturbed: float
    weakening: float
    control: float
    jump: float

    @property
    def rise(self) -> float:
        """Decades between the largest D of the perturbed run and of the one with mu(v)."""
        return float(np.log10(self.weakening / self.perturbed))

    @property
    def control_rise(self) -> float:
        """The same with the control in place of the run with mu(v)."""
        return float(np.log10(self.control / self.perturbed))

    @property
    def grows(self) -> bool:
        """Whether D goes on to grow after the jump."""
        return self.weakening >= GROWTH_FACTOR * self.jump


@dataclass(frozen=True)
class Member:
    """What was found for one packing.

    Attributes
    ----------
    seed : int
        Of its loose start.
    ramps : tuple of RampEnd
        One for each friction coefficient: the scene's first one first, what it weakens to last.
    lowered : bool or None
        Whether weakening friction lowers the onset; None if that cannot be known.
    eruption : Eruption or None
        None without a window between the two onsets, or without [perturb] in the scene.
    says : str or None
        What went wrong, if something did; what is there then was found before.
    seconds : float
        Wall time.
    """

    seed: int
    ramps: tuple[RampEnd, ...] = ()
    lowered: bool | None = None
    eruption: Eruption | None = None
    says: str | None = None
    seconds: float = 0.0

    @classmethod
    def from_dict(cls, row: dict[str, Any]) -> Member:
        """A member from a line of ensemble.jsonl."""
        ramps = tuple(RampEnd(**each) for each in row["ramps"])
        eruption = None if row["eruption"] is None else Eruption(**row["eruption"])
        return cls(row["seed"], ramps, row["lowered"], eruption, row["says"], row["seconds"])


def ensemble(
    scene: Scene,
    members: int,
    output: Path,
    say: Say = print,
    progress: Callable[[Iterator[Member], int], Iterable[Member]] = lambda results, _: results,
) -> dict[str, Any]:
    """Examine packings and leave ensemble.jsonl, ensemble.json and a figure in a folder.

    Every packing is a line of ensemble.jsonl as soon as it is done, and lines of the same scene that are there already
    are not computed again, so that an ensemble may be cut off, or enlarged. Under `mpiexec -n K` all K ranks call
    this; one hands out the packings, the others take them one by one.

    Parameters
    ----------
    scene : Scene
        With a generated packing and [ramp]; with [friction] and [perturb] for eruptions. perturb.fx is not used.
    members : int
        Number of packings M: those of the seeds seed, ..., seed + M - 1.
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of progress.
    progress : callable
        Takes the members that end and their number, and hands the members on.

    Returns
    -------
    dict
        What ensemble.json holds; empty on ranks other than 0.

    Raises
    ------
    SceneError
        If the scene has no generated packing or no section [ramp].
    """
    seeds = _seeds(scene, members)
    workers: AbstractContextManager[Any] = (
        nullcontext() if MPI.COMM_WORLD.size == 1 else MPICommExecutor(MPI.COMM_WORLD)
    )
    with workers as pool:
        if MPI.COMM_WORLD.rank != 0:
            return {}
        output.mkdir(parents=True, exist_ok=True)
        lines = output / "ensemble.jsonl"
        known = stored(lines, scene)
        ended = [known[seed] for seed in seeds if seed in known]
        if ended:
            say(f"{len(ended)} of {members} packings are in {lines} already")
        missing = [seed for seed in seeds if seed not in known]
        with closing(_examined(pool, scene, missing)) as results:
            for member in progress(results, len(missing)):
                append(lines, scene, member)
                say(sentence(member))
                ended.append(member)
    ended.sort(key=lambda member: member.seed)
    result = summary(scene, ended)
    (output / "ensemble.json").write_text(json.dumps(result, indent=1) + "\n")
    save(ensemble_figure(ended), output / "ensemble")
    for line in words(result):
        say(line)
    return result


def _seeds(scene: Scene, members: int) -> range:
    if not isinstance(scene.packing, GeneratedPacking):
        raise SceneError("an ensemble needs packings of several seeds, and the scene has a stored one: give a seed")
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    return range(scene.packing.seed, scene.packing.seed + members)


def _examined(pool: MPIPoolExecutor | None, scene: Scene, seeds: list[int]) -> Generator[Member, None, None]:
    """Members as they end; closing the iterator takes back those that no worker has begun."""
    one = partial(examine, scene)
    yield from map(one, seeds) if pool is None else pool.map(one, seeds, unordered=True)


def economical(scene: Scene) -> Scene:
    """The scene with increments and undamped runs that take seconds a packing, see `FINEST_STEP` and `LONGEST_TIME`."""
    changes: dict[str, Any] = {}
    if scene.ramp is not None:
        step = min(max(scene.ramp.step, FINEST_STEP), scene.ramp.until)
        changes["ramp"] = scene.ramp.model_copy(update={"step": step})
    if scene.perturb is not None:
        changes["perturb"] = scene.perturb.model_copy(update={"time": min(scene.perturb.time, LONGEST_TIME)})
    return scene.model_copy(update=changes)


def examine(scene: Scene, seed: int) -> Member:
    """Onsets of one packing, and whether it erupts between them; on this process alone, with one thread.

    What goes wrong with one packing is in its `says`, and does not end the ensemble.
    """
    begin = time.perf_counter()
    member = Member(seed)
    with threadpool_limits(1):
        try:
            for found in _examination(scene, member):
                member = found
        except (RuntimeError, ValueError) as error:  # of the engine, the solver, LAPACK, or a scene without room
            member = replace(member, says=str(error))
    return replace(member, seconds=round(time.perf_counter() - begin, 3))


def _examination(scene: Scene, member: Member) -> Iterator[Member]:
    """The member after each stage, so that a stage that fails takes nothing along."""
    resolved = scene.resolved()
    one = Scene.from_mapping(resolved | {"packing": resolved["packing"] | {"seed": member.seed}})
    paths: list[tuple[Equilibrium, ...]] = []
    for mu in _frictions(scene):
        end, path = first_onset(one, mu)
        paths.append(path)
        member = replace(member, ramps=(*member.ramps, end))
        yield member
    if len(member.ramps) < 2:
        return
    strong, weak = member.ramps[0], member.ramps[-1]
    member = replace(member, lowered=lowers(strong, weak))
    yield member
    if member.lowered and strong.fx_c is not None and one.perturb is not None and one.friction is not None:
        yield replace(member, eruption=_eruption(one, paths[0], (weak.reach, strong.fx_c), one.perturb, one.friction))


def _frictions(scene: Scene) -> tuple[float, ...]:
    """The scene's friction coefficients, the one that weakens first and what it weakens to last."""
    if scene.friction is None:
        return scene.law.mus
    weak = scene.friction.mu_ss * scene.law.mus[0]
    # 0.8 * 0.7 is not 0.56 to the last bit
    return (*(mu for mu in scene.law.mus if not np.isclose(mu, weak, rtol=1e-12, atol=0.0)), weak)


def first_onset(scene: Scene, mu: float) -> tuple[RampEnd, tuple[Equilibrium, ...]]:
    """Where the ramp of a scene first has a complex pair, and its equilibria up to there.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    mu : float
        Friction coefficient.

    Raises
    ------
    NoEquilibriumError
        If the packing does not settle.
    """
    assert scene.ramp is not None
    start = settle(scene, mu, MPI.COMM_SELF)
    with Engine(start.packing, MPI.COMM_SELF) as engine:
        path = EquilibriumPath(engine, start, scene)
        for here, there in pairwise(loads(scene.ramp)):
            try:
                path(float(there))
            except NoEquilibriumError:
                return RampEnd(mu, "flows", float(here)), tuple(path.kept)
            try:
                # as wide as find_onset takes them on the whole ramp
                onset = find_onset(path, [here, there], narrowest=1e-7 * scene.ramp.until)
            except OnsetError:
                continue
            return RampEnd(mu, "onset", onset.fx_c, onset.error), tuple(path.kept)
        return RampEnd(mu, "until", path.kept[-1].fx), tuple(path.kept)


def lowers(strong: RampEnd, weak: RampEnd) -> bool | None:
    """Whether the onset with weakened friction is the lower one; None if both may be."""
    if weak.fx_c is not None and weak.reach < strong.reach:
        return True
    # the weak one has none up to there, or a later one
    return False if strong.fx_c is not None and strong.reach <= weak.reach else None


def _eruption(
    scene: Scene,
    path: tuple[Equilibrium, ...],
    window: tuple[float, float],
    settings: Perturb,
    friction: Friction,
) -> Eruption:
    """The runs in a window between two onsets, and the control; path leads up to the upper one."""
    middle = 0.5 * (window[0] + window[1])
    start, below = (_equilibrium_at(scene, path, fx) for fx in (middle, max(0.0, 2 * window[0] - middle)))

    def msd(start: Equilibrium, weakening: Weakening | None) -> Floats:
        return column(_undamped(scene, settings, start, settings.amplitude, weakening), "msd")

    quiet = _undamped(scene, settings, start, 0.0)
    v0 = np.abs(column(quiet, "layer_velocity")).max() if isinstance(friction.v0, str) else friction.v0
    weakening = weakening_of(friction, float(v0))
    weakened = _undamped(scene, settings, start, settings.amplitude, weakening)
    return Eruption(
        fx=start.fx,
        fx_control=below.fx,
        rate=weakened_rate(start.packing, friction.mu_ss),
        unperturbed=float(column(quiet, "msd").max()),
        perturbed=float(msd(start, None).max()),
        weakening=float(column(weakened, "msd").max()),
        control=float(msd(below, weakening).max()),
        jump=jump(weakened),
    )


def _equilibrium_at(scene: Scene, path: tuple[Equilibrium, ...], fx: float) -> Equilibrium:
    below = max((each for each in path if each.fx <= fx), key=lambda each: each.fx)
    with Engine(below.packing, MPI.COMM_SELF) as engine:
        return below if below.fx == fx else next_equilibrium(engine, below, fx, scene)


def _undamped(
    scene: Scene, settings: Perturb, start: Equilibrium, amplitude: float, weakening: Weakening | None = None
) -> tuple[Sample, ...]:
    one = scene.model_copy(update={"perturb": settings.model_copy(update={"fx": start.fx, "amplitude": amplitude})})
    return tuple(perturb(one, start, communicator=MPI.COMM_SELF, weakening=weakening))


def weakened_rate(packing: Packing, mu_ss: float) -> float:
    """Fastest growth rate of D with friction mu mu_ss in the same configuration, 1 / time; 0 if it is stable."""
    law = replace(packing.law, mu=mu_ss * packing.law.mu)
    limit = law.slip_limit(packing.geometry.overlap)
    slip = np.clip(packing.contacts.slip, -limit, limit)
    modes = spectrum(replace(packing, law=law, contacts=replace(packing.contacts, slip=slip)))
    return max((pair.growth_rate for pair in modes.pairs), default=0.0)


def stored(path: Path, scene: Scene) -> dict[int, Member]:
    """The members of a scene in ensemble.jsonl, by seed.

    Lines of other scenes are left alone. A last line that a crash cut short is taken off the file.
    """
    if not path.exists():
        return {}
    text = path.read_text()
    complete = text[: text.rfind("\n") + 1]
    if complete != text:
        path.write_text(complete)
    rows = [json.loads(line) for line in complete.splitlines()]
    return {row["seed"]: Member.from_dict(row) for row in rows if row["scene"] == fingerprint(scene)}


def append(path: Path, scene: Scene, member: Member) -> None:
    """Write a member; it is in the file when this returns."""
    row = {"scene": fingerprint(scene), "version": version("faultgouge")} | asdict(member)
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")


def fingerprint(scene: Scene) -> str:
    """Twelve hexadecimal digits that stand for the scene, its seed and perturb.fx left aside."""
    resolved = scene.resolved()
    resolved["packing"].pop("seed", None)
    resolved.get("perturb", {}).pop("fx", None)
    return hashlib.sha256(json.dumps(resolved, sort_keys=True).encode()).hexdigest()[:12]


def share(count: int, of: int) -> dict[str, Any]:
    """count/of with Wilson's 95 % interval: {"count", "of", "share", "low", "high"}, the last three None for of = 0."""
    if of == 0:
        return {"count": 0, "of": 0, "share": None, "low": None, "high": None}
    interval = binomtest(count, of).proportion_ci(0.95, method="wilson")
    return {"count": count, "of": of, "share": count / of, "low": float(interval.low), "high": float(interval.high)}


def distribution(ends: Iterable[RampEnd]) -> tuple[Floats, Floats]:
    """Kaplan and Meier's distribution of F_x^c: onsets, and the share of packings up to each; both of shape (n,)."""
    ends = list(ends)
    if not any(end.ends == "onset" for end in ends):
        return np.empty(0), np.empty(0)
    reach, censored = [end.reach for end in ends], [end.ends != "onset" for end in ends]
    steps = ecdf(CensoredData.right_censored(reach, censored)).cdf
    rises = np.diff(steps.probabilities, prepend=0.0) > 0
    return steps.quantiles[rises], steps.probabilities[rises]


def quartiles(ends: Iterable[RampEnd]) -> list[float | None]:
    """Lower quartile, median and upper quartile of F_x^c; None where they lie beyond what the ramps reached."""
    fx, probability = distribution(ends)
    # 3/4 from products of shares may miss 3/4 by its rounding
    places = np.searchsorted(probability, np.array([0.25, 0.5, 0.75]) - 1e-12)
    return [float(fx[place]) if place < len(fx) else None for place in places]


def summary(scene: Scene, members: list[Member]) -> dict[str, Any]:
    """Numbers for ensemble.json."""
    ramped = [member for member in members if len(member.ramps) == len(_frictions(scene))]
    eruptions = [member.eruption for member in ramped if member.eruption is not None]
    rises, controls = [each.rise for each in eruptions], [each.control_rise for each in eruptions]
    decided = [member.lowered for member in ramped if member.lowered is not None]
    return {
        "scene": scene.resolved(),
        "seeds": sorted(member.seed for member in members),
        "failed": [{"seed": each.seed, "says": each.says} for each in members if each.says is not None],
        "onsets": [_onset_summary([member.ramps[k] for member in ramped]) for k in range(len(_frictions(scene)))]
        if ramped
        else [],
        "lowered": share(sum(decided), len(decided)),
        "lowered_unknown": len(ramped) - len(decided),
        "rises": {str(decades): share(sum(rise >= decades for rise in rises), len(rises)) for decades in RISES},
        "control_rises": {
            str(decades): share(sum(rise >= decades for rise in controls), len(controls)) for decades in RISES
        },
        "rise_quartiles": _quartiles(rises),
        "control_rise_quartiles": _quartiles(controls),
        "unstable_when_weakened": share(sum(each.rate > 0 for each in eruptions), len(eruptions)),
        "grows": share(sum(each.grows for each in eruptions), len(eruptions)),
        "seconds_per_packing": float(np.median([member.seconds for member in members])) if members else None,
    }


def _quartiles(values: list[float]) -> list[float] | None:
    return np.quantile(values, [0.25, 0.5, 0.75]).tolist() if values else None


def _onset_summary(ends: list[RampEnd]) -> dict[str, Any]:
    return {
        "mu": ends[0].mu,
        "found": share(sum(end.ends == "onset" for end in ends), len(ends)),
        "none_until": sum(end.ends == "until" for end in ends),
        "flows": sum(end.ends == "flows" for end in ends),
        "quartiles": quartiles(ends),
    }


def sentence(member: Member) -> str:
    """What was found for one packing, in one line."""
    parts = [
        f"mu = {end.mu:g}: "
        + {
            "onset": f"F_x^c = {end.reach:.6g}",
            "until": f"no onset up to {end.reach:g}",
            "flows": f"no onset, flows beyond {end.reach:g}",
        }[end.ends]
        for end in member.ramps
    ]
    if member.eruption is not None:
        found = member.eruption
        parts.append(
            f"D rises {found.rise:.1f} decades at {found.fx:.6g} (control: {found.control_rise:.1f}) and "
            f"{'grows' if found.grows else 'does not grow'} after its jump"
        )
    if member.says is not None:
        parts.append(f"failed: {member.says}")
    return f"seed {member.seed}: {'; '.join(parts)} ({member.seconds:.0f} s)"


def words(result: dict[str, Any]) -> list[str]:
    """The summary in plain words."""
    lines = [f"{len(result['seeds'])} packings, of which {len(result['failed'])} failed"]
    for onset in result["onsets"]:
        low, median, high = ("beyond" if each is None else f"{each:.4g}" for each in onset["quartiles"])
        lines.append(
            f"mu = {onset['mu']:g}: an onset in {_percent(onset['found'])}, {onset['flows']} flow before, "
            f"{onset['none_until']} have none up to the end; F_x^c: median {median}, quartiles {low} and {high}"
        )
    lines.append(
        f"weakening friction lowers the onset in {_percent(result['lowered'])}; not known for "
        f"{result['lowered_unknown']} more"
    )
    if result["grows"]["of"] == 0:
        return lines
    lines += [
        f"rise of D by {decades} decades or more: {_percent(found)} of the packings with a window between the onsets, "
        f"and {_percent(result['control_rises'][decades])} of their controls below both onsets"
        for decades, found in result["rises"].items()
    ]
    lines.append(
        f"unstable with the weakened friction, by the spectrum: {_percent(result['unstable_when_weakened'])}; "
        f"D goes on to grow after its jump: {_percent(result['grows'])}"
    )
    return lines


def _percent(found: dict[str, Any]) -> str:
    if found["of"] == 0:
        return "0 of 0"
    return (
        f"{found['count']} of {found['of']} ({100 * found['share']:.0f} %, 95 % interval {100 * found['low']:.0f} to "
        f"{100 * found['high']:.0f} %)"
    )


@matplotlib.rc_context(fname=STYLE)
def ensemble_figure(members: Iterable[Member]) -> Figure:
    """Onsets of an ensemble, both friction coefficients against each other, and the rise of D.

    Parameters
    ----------
    members : iterable of Member
        Those without ramps are not drawn.

    Returns
    -------
    Figure
        Panel (a) the share of packings with an onset up to F_x, for each friction coefficient, with ticks where
        packings are lost from sight without one; (b) the onset with the weakened friction over that with the
        first, filled where D went on to grow after its jump, triangles where one of the two is only known to lie
        beyond; (c) how many packings rose by how many decades, and how many controls.
    """
    members = [member for member in members if member.ramps]
    figure = Figure(figsize=(3.4, 6.0), layout="constrained")
    onsets, pairs, rises = figure.subplots(3, 1, height_ratios=(1, 1.5, 1))
    mus = list(dict.fromkeys(end.mu for member in members for end in member.ramps))
    for number, mu in enumerate(mus):
        ends = [end for member in members for end in member.ramps if end.mu == mu]
        fx, probability = distribution(ends)
        levels = np.concatenate([[0.0], probability])
        places = np.concatenate([[0.0], fx, [max(end.reach for end in ends)]])
        curve = np.append(levels, levels[-1])
        onsets.step(places, curve, where="post", color=f"C{number}", label=rf"$\mu = {mu:g}$")
        lost = np.array([end.reach for end in ends if end.ends != "onset"])
        onsets.plot(lost, levels[np.searchsorted(fx, lost, side="right")], "|", color=f"C{number}")
    onsets.set(xlabel="$F_x^c$", ylabel="share of packings", ylim=(0, 1))
    if mus:
        onsets.legend()
    _draw_pairs(pairs, [member for member in members if len(member.ramps) > 1])
    eruptions = [member.eruption for member in members if member.eruption is not None]
    if eruptions:
        decades = [[each.rise for each in eruptions], [each.control_rise for each in eruptions]]
        edges = np.arange(np.floor(np.min(decades)), np.max(decades) + 0.5, 0.5)
        rises.hist(decades, bins=edges, label=["in the window", "control"], color=["C0", "C1"])
        rises.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2)
        rises.yaxis.set_major_locator(MaxNLocator(integer=True))
    rises.set(xlabel="rise of $D$ in decades", ylabel="packings")
    for axes, name in ((onsets, "(a)"), (pairs, "(b)"), (rises, "(c)")):
        axes.set_title(name, loc="left", fontsize=8.5)
    return figure


def _draw_pairs(axes: Axes, members: list[Member]) -> None:
    """Onsets with the weakened friction over those with the first; triangles where one is known to lie beyond."""
    most = 0.0
    for member in members:
        strong, weak = member.ramps[0], member.ramps[-1]
        if strong.fx_c is None and weak.fx_c is None:
            continue
        most = max(most, strong.reach, weak.reach)
        marker = ">" if strong.fx_c is None else "^" if weak.fx_c is None else "o"
        face = "C0" if member.eruption is not None and member.eruption.grows else "none"
        axes.plot(strong.reach, weak.reach, marker, color="C0", markerfacecolor=face, markeredgewidth=0.7)
    axes.axline((0, 0), slope=1, color=INK, linewidth=0.6, linestyle=":")
    axes.set(xlim=(0, 1.05 * most or 1), ylim=(0, 1.05 * most or 1), aspect="equal")
    if members:
        strong, weak = members[0].ramps[0], members[0].ramps[-1]
        axes.set(xlabel=rf"$F_x^c(\mu = {strong.mu:g})$", ylabel=rf"$F_x^c(\mu = {weak.mu:g})$")
