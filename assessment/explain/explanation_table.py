"""An explanation in two sentences, and as a table for a terminal."""

from collections.abc import Mapping

from rich.console import Group
from rich.table import Table
from rich.text import Text

from .cost_comparison import Cost
from .explain import Explanation


def in_words(explanation: Explanation) -> str:
    """Two sentences: which parts the scene has and which it leaves out, and how much time that saves, if it was timed.

    What is saved is told for parts that a step would take longer with, by more than their quartiles leave open: what
    they would cost one at a time.
    """
    inside = [part.name for part in explanation.parts if part.included]
    outside = [part for part in explanation.parts if not part.included]
    saves = {
        part.name: 100 * (part.cost.ratio[1] - 1)
        for part in outside
        if part.cost is not None and part.cost.per == "step" and part.cost.ratio[0] > 1
    }
    first = f"In: {_join_names(inside)}. Out: {_join_names([part.name for part in outside])}"
    if not explanation.timed:
        return f"{first}."
    if not saves:
        return f"{first}; that saves no time that can be measured."
    dearest = sorted(saves, key=lambda name: -saves[name])
    each = _join_names([f"{saves[name]:.0f} % for {name}" for name in dearest])
    return f"{first}. A step would take longer by {each}, one at a time."


def units_in_words(units: Mapping[str, float]) -> str:
    """A sentence: stiffness and load of the scene, what they stand for, and one unit of the scene in SI."""
    length, mass, time, force = (units[name] for name in ("length_m", "mass_kg", "time_s", "force_N"))
    return (
        f"law.kn = {units['kn']:.12g} (Hertz's contact of the grains) and load.fy = {units['fy']:.12g} "
        f"({units['overburden_Pa']:.4g} Pa on the layer); one unit of the scene is {length:.4g} m, {mass:.4g} kg, "
        f"{time:.4g} s and {force:.4g} N."
    )


def _join_names(names: list[str]) -> str:
    *others, last = names or ["nothing"]
    return f"{', '.join(others)} and {last}" if others else last


def explanation_table(explanation: Explanation) -> Group:
    """A line for each feature, and below it what the scene's run has loaded."""
    title = explanation.remark
    if explanation.timed:
        title += f"; load average {explanation.load_average:.1f}"
    table = Table(title=title, title_justify="left", caption_justify="left")
    for heading in ("feature", "in", "because", "brings"):
        table.add_column(heading)
    if explanation.timed:
        table.add_column("time with it : without it [quartiles]")
    table.add_column("the same to the bit")
    for part in explanation.parts:
        times = [Text(_cost(part.cost))] if explanation.timed else []
        table.add_row(
            part.name,
            Text("in", style="green") if part.included else Text("out"),
            Text(part.reason),
            Text(", ".join(part.adds)),
            *times,
            Text(f"no: {part.same}", style="bold") if part.identical is False else Text(part.same),
        )
    loaded = explanation.loaded
    lines = {
        "deck parts": loaded.parts,
        "fixes": loaded.fixes,
        "computes": loaded.computes,
        "per-atom arrays": loaded.arrays,
        "imported": explanation.imported,
        "not imported": explanation.left_out,
        "by default": tuple(f"{key} = {value}" for key, value in explanation.defaults.items()),
    }
    return Group(table, *(Text(f"{name}: {', '.join(held) or 'none'}") for name, held in lines.items()))


def _cost(cost: Cost | None) -> str:
    if cost is None:
        return "not measured"
    low, middle, high = cost.ratio
    without, with_it = cost.medians
    return f"{middle:.2f} [{low:.2f}, {high:.2f}]: {_duration(with_it)} : {_duration(without)} per {cost.per}"


def _duration(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} µs"
