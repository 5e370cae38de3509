"""The numbers of the study from its tables, each with its interval and the number of packings."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import Floats
from faultgouge.studies.statistics import quartiles, share, sign_test
from research.genericity.fits import shape, size_law
from research.genericity.sets import FRICTION
from research.genericity.table import Table
from research.statistics import exponent, median_interval

LOADS = (0.005, 0.01, 0.02, 0.03)
"""F_x below which shares of packings with an onset are given."""

SAME = 1e-6
"""Relative difference of two onsets of one packing below which they are the same: increments matter less than that
where no contact opens, closes or slides."""

STEPS = [(1.0, 0.8), (0.8, 0.6), (0.6, 0.4), (0.4, 0.2), (1.0, 0.2)]
"""Friction coefficients between which the onset is compared."""


def read_tables(folder: Path) -> dict[str, Table]:
    """The tables of the study by the names of their sets."""
    return {path.parent.name.replace("_", " "): Table.read(path) for path in sorted(folder.glob("*/results.csv"))}


def numbers(tables: dict[str, Table]) -> dict[str, Any]:
    """All numbers that the page states."""
    empty = Table()
    onsets = tables.get("onsets", empty)
    reference = onsets.where(law_mu=1.0)
    return {
        "onsets": [of_friction(onsets.where(law_mu=mu)) | {"mu": mu} for mu in FRICTION],
        "lowered": [compare_friction(onsets, *pair) | {"from": pair[0], "to": pair[1]} for pair in STEPS],
        "kinds": [kinds(onsets.where(law_mu=mu)) | {"mu": mu} for mu in FRICTION],
        "modes": [modes(onsets.where(law_mu=mu)) | {"mu": mu} for mu in FRICTION],
        "shape": shape(reference.at_rest.reach, reference.at_rest.found),
        "settled": settled_with_friction(tables.get("settled with friction", empty)),
        "halved": compare_halved(onsets, tables.get("halved increments", empty)),
        "harmonic": harmonic(onsets, tables.get("harmonic", empty)),
        "sizes": {name: sizes(tables.get(name, empty), reference) for name in ("fixed force", "fixed pressure")},
        "levels": levels(tables.get("levels", empty)),
        "growth": growth(tables.get("growth", empty)),
        "surrogates": surrogates(tables.get("surrogates", empty), reference),
    }


def of_friction(table: Table) -> dict[str, Any]:
    """How the ramps of one friction coefficient end."""
    good = table.at_rest
    reach, found = good.reach, good.found
    ends = good.column("ends")
    below = []
    for load in LOADS:
        known = (found & (reach <= load)) | (reach >= load * (1 - 1e-9))
        below.append({"load": load} | share(int(np.sum(found & (reach <= load))), int(np.sum(known))))
    return {
        "packings": len(table),
        "failed": len(table.where_known("says")),
        "until": ends.count("until"),
        "flows": ends.count("flows"),
        "found": share(int(found.sum()), len(good)),
        "below": below,
        "median": median_interval(reach, found),
        "quartiles": quartiles(reach, found),
    }


def compare_friction(onsets: Table, strong: float, weak: float) -> dict[str, Any]:
    """Whether a smaller friction coefficient lowers the onset, and what is different where it does not."""
    first, second = (onsets.where(law_mu=mu).at_rest for mu in (strong, weak))
    both = first.beside(second, "packing.seed")
    decided = [(lower, a, b) for a, b in both if (lower := sign_test(a, b)) is not None]
    pairs = [each for each in decided if each[1]["ends"] == each[2]["ends"]]
    same = [(lower, a, b) for lower, a, b in pairs if a["ancestors"] and a["ancestors"] == b["ancestors"]]
    ends = [lower for lower, a, b in decided if a["ends"] != b["ends"]]
    of_same, of_all = sum(lower for lower, *_ in same), sum(lower for lower, *_ in pairs)
    return {
        "lowered": share(of_all + sum(ends), len(decided)),
        "unknown": len(both) - len(decided),
        "same": share(len(same), len(pairs)),
        "lowered_same": share(of_same, len(same)),
        "lowered_other": share(of_all - of_same, len(pairs) - len(same)),
        "ratio_same": _median_and_quartiles(np.array([b["reach"] / a["reach"] for _, a, b in same])),
        "appears": ends.count(False),
        "vanishes": ends.count(True),
    }


def kinds(onsets: Table) -> dict[str, Any]:
    """Shares of the kinds of the first edge, and of contacts that change before, with one friction coefficient."""
    words = onsets.where_known("kind").column("kind")
    counts = {"sliding": onsets.numbers("sliding"), "changed": onsets.numbers("opened") + onsets.numbers("closed")}
    return {"coalescence": share(words.count("coalescence"), len(words))} | {
        name: share(int(np.sum(each > 0)), int(np.isfinite(each).sum())) for name, each in counts.items()
    }


def modes(onsets: Table) -> dict[str, Any]:
    """Which modes meet, in packings with one friction coefficient."""
    found = onsets.where_known("rank")
    place = found.numbers("rank") / found.numbers("modes")
    neighbours = [second - first == 1 for first, second in found.column("ancestors")]
    columns = {"place": place, "frequency": np.sqrt(found.numbers("lambda") / found.numbers("largest"))}
    columns |= {name: found.numbers(name) for name in ("participation", "rotation", "layer", "ancestry")}
    return {
        "onsets": len(found),
        "lowest": share(int(np.sum(place < 1 / 3)), len(found)),
        "neighbours": share(sum(neighbours), len(neighbours)),
    } | {name: _median_and_quartiles(values) for name, values in columns.items()}


def _median_and_quartiles(values: Floats) -> dict[str, Any]:
    """Median with its interval, and quartiles, of numbers that are all known."""
    found = np.ones(len(values), dtype=bool)
    return {"median": median_interval(values, found), "quartiles": quartiles(values, found)}


def settled_with_friction(table: Table) -> dict[str, Any]:
    """Packings that have settled with friction: complex pairs at rest."""
    good = table.at_rest
    return {
        "packings": len(set(table.column("packing.seed"))),
        "rows": len(good),
        "start": share(good.column("kind").count("start"), len(good)),
    }


def compare_halved(onsets: Table, finer: Table) -> dict[str, Any]:
    """Onsets with increments half as large."""
    both = onsets.at_rest.beside(finer.at_rest, "packing.seed", "law.mu")
    off = np.array([abs(b["reach"] / a["reach"] - 1) for a, b in both if a["ends"] == b["ends"] == "onset"])
    return {
        "rows": len(both),
        "ends": share(sum(a["ends"] == b["ends"] for a, b in both), len(both)),
        "same": share(int(np.sum(off < SAME)), len(off)),
        "largest": float(off.max()) if len(off) else None,
        "typical": float(np.median(off)) if len(off) else None,
    }


def harmonic(onsets: Table, table: Table) -> list[dict[str, Any]]:
    """The onsets of the law with exponent 1 beside those of the same packings' seeds with 3/2."""
    result = []
    for mu in sorted(set(table.column("law.mu"))):
        own, other = table.where(law_mu=mu).at_rest, onsets.where(law_mu=mu).at_rest
        result.append({"mu": mu, "harmonic": of_friction(table.where(law_mu=mu)), "p": _logrank(own, other)})
    return result


def sizes(table: Table, reference: Table) -> dict[str, Any]:
    """The onset over the number of disks, in units of F_y; the packings of 100 disks are those of the first set."""
    parts = {disks: table.where(packing_disks=disks).at_rest for disks in set(table.column("packing.disks"))}
    rows, disks, reach, found = [], [], [], []
    for number, part in sorted([*parts.items(), (100, reference.at_rest)]):
        load = np.full(len(part), 3.0) if number == 100 else part.numbers("load.fy")
        scaled = part.reach / load
        row: dict[str, Any] = {"disks": number, "packings": len(part), "onsets": int(part.found.sum())}
        row |= {"flows": part.column("ends").count("flows"), "median": median_interval(scaled, part.found)}
        rows.append(row | {"doubtful": int(np.sum(part.numbers("doubtful") > 0))})
        disks.append(np.full(len(part), float(number)))
        reach.append(scaled)
        found.append(part.found)
    law = size_law(np.concatenate(disks), np.concatenate(reach), np.concatenate(found)) if len(table) else None
    return {"rows": rows, "law": law}


def levels(table: Table) -> dict[str, Any]:
    """Levels, couplings and the predicted scale over the number of disks, in units of F_y, and their exponents."""
    good = table.at_rest
    disks = good.numbers("packing.disks")
    load = good.numbers("load.fy")
    columns = {name: good.numbers(name) for name in ("spacing", "ratio", "coupling", "speed", "participation")}
    for name in ("coupling", "speed"):  # per force in spacings -> per F_x/F_y, 1 / time^2
        columns[name] = columns[name] * load * columns["spacing"]
    columns["median"] = good.numbers("f0") / load * np.sqrt(np.log(2))
    rows: list[dict[str, Any]] = []
    for number in np.unique(disks):
        mine = disks == number
        means = {name: _mean(values[mine]) for name, values in columns.items()}
        rows.append({"disks": int(number), "packings": int(mine.sum())} | means)
    exponents = {name: _slope(disks, values) for name, values in columns.items() if name != "ratio"}
    exponents["coupling over spacing"] = _slope(disks, columns["coupling"] / columns["spacing"])
    return {
        "rows": rows,
        "exponents": exponents,
        "f0": (good.numbers("f0") / load).tolist(),
        "disks": disks.tolist(),
        "expected": expected_onsets(good.numbers("f0")[disks == 100]),
    }


def expected_onsets(f0: Floats, until: float = 0.03, draws: int = 10) -> dict[str, Any] | None:
    """Onsets up to a load that packings with these F_0 have on average, and the Weibull shape that their spread gives.

    The shape is fitted to the quantiles of (F/F_0)^2, `draws` a packing, censored at `until`; None without packings.
    """
    if not len(f0):
        return None
    quantiles = (np.arange(draws) + 0.5) / draws
    loads = np.outer(f0, np.sqrt(-np.log1p(-quantiles))).ravel()
    found = shape(np.minimum(loads, until), loads <= until)
    return {
        "packings": len(f0),
        "onsets": float(np.sum(-np.expm1(-((until / f0) ** 2)))),
        "shape": found["shape"]["value"],
    }


def growth(table: Table) -> list[dict[str, Any]]:
    """Largest growth rate over the load, by number of disks: medians over packings at common loads."""
    result = []
    for number in sorted(set(table.column("packing.disks"))):
        part = table.where(packing_disks=number).where_known("fx").rows
        points = []
        for k in range(max((len(row["fx"]) for row in part), default=0)):
            long = [row for row in part if len(row["fx"]) > k]
            load = float(np.array(long[0]["fx"])[k] / long[0]["load.fy"])
            low, median, high = np.quantile([row["rate"][k] for row in long], [0.25, 0.5, 0.75]).tolist()
            points.append({"load": load, "of": len(long), "low": low, "median": median, "high": high})
        result.append({"disks": number, "packings": len(part), "points": points})
    return result


def surrogates(table: Table, reference: Table) -> dict[str, Any]:
    """Onsets of the surrogates beside those of the packings of the same seeds."""
    seeds = set(table.column("packing.seed"))
    own = Table(tuple(row for row in reference.rows if row["packing.seed"] in seeds)).at_rest
    result: dict[str, Any] = {"packings": len(seeds), "own": _ends(own)}
    for name in ("linear", "random", "shuffled"):
        part = Table(
            tuple(
                {"packing.seed": row["packing.seed"], "ends": row[f"{name}.ends"], "reach": row[f"{name}.reach"]}
                for row in table.where_known(f"{name}.ends").rows
            )
        )
        result[name] = _ends(part) | signs(own.beside(part, "packing.seed"))
    return result


def signs(pairs: Iterable[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    """The sign test of pairs: in how many the second has the lower onset, of how many that differ.

    Parameters
    ----------
    pairs : iterable of tuple
        Rows with "ends" and "reach" of one packing.

    Returns
    -------
    dict
        "lower", "of", and "p", the probability of a division as uneven, or more, if both were equally likely. Pairs are
        left out that are equal or of which it is not known which onset is the lower.
    """
    from scipy.stats import binomtest  # half a second to import

    differ = [pair for pair in pairs if pair[0]["reach"] != pair[1]["reach"]]
    decided = [verdict for pair in differ if (verdict := sign_test(*pair)) is not None]
    lower = sum(decided)
    return {"lower": lower, "of": len(decided), "p": binomtest(lower, len(decided)).pvalue if decided else None}


def _ends(table: Table) -> dict[str, Any]:
    return {
        "found": share(int(table.found.sum()), len(table)),
        "median": median_interval(table.reach, table.found),
        "reach": table.reach.tolist(),
        "is_onset": table.found.tolist(),
    }


def _logrank(one: Table, other: Table) -> float | None:
    """Probability of a difference as large, or larger, between two samples of one distribution."""
    if not (one.found.any() and other.found.any()):
        return None
    from scipy.stats import CensoredData, logrank  # half a second to import

    samples = [CensoredData.right_censored(each.reach, ~each.found) for each in (one, other)]
    return float(logrank(*samples).pvalue)


def _mean(values: Floats) -> dict[str, float | None]:
    """The mean and half of its 95 % interval (Student's); no interval of a single value."""
    count = len(values)
    from scipy.stats import t as student

    error = float(student.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count)) if count > 1 else None
    return {"value": float(np.mean(values)), "error": error}


def _slope(disks: Floats, values: Floats) -> dict[str, float] | None:
    """The exponent of a power law, with its 95 % interval from resampled packings within each size."""
    sizes = np.unique(disks)
    if len(sizes) < 2:
        return None
    return exponent(sizes, [values[disks == size] for size in sizes], lambda each: float(np.mean(np.log(each))), 1000)
