"""Summary of a sweep of the task "triggering": shares of its scenes with intervals, in numbers and in words.

See :mod:`.triggering` for the quantities, and :mod:`~faultgouge.studies.statistics` for shares, intervals and
distributions. No result is dropped: a scene that fails counts with all results found before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...figures.pages import lines
from ..statistics import quartiles, share
from .table import Row
from .triggering import grows, rise_in_decades

RISES_IN_DECADES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""

QUARTILES = (0.25, 0.5, 0.75)


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise the rows of a sweep of the task "triggering" in numbers.

    Parameters
    ----------
    rows : sequence of dict
        As `run_sweep` returns them.

    Returns
    -------
    dict
        onsets : for each friction coefficient how the ramps end, with quartiles of F_x^c; lowered : share in which
        weakening friction lowers the onset; lowered_unknown : how many others do not tell; rises, control_rises : by
        decades, the share of the runs with mu(v) whose D rises by so much, and of the controls; rise_quartiles,
        control_rise_quartiles : decades, or None; unstable_when_weakened, grows, perturbation_shows : shares of the
        scenes with runs. A share is what `share` returns.
    """
    ramps = [end for row in rows for end in row["result"].get("ramps", ())]
    eruptions = [found for row in rows if (found := row["result"].get("eruption"))]
    several = [row for row in rows if len(row["result"].get("ramps", ())) > 1]
    decided = [row["result"]["lowered"] for row in several if row["result"]["lowered"] is not None]
    undecided = [row for row in several if row["result"]["lowered"] is None and row["says"] is None]
    rises, controls = ([rise_in_decades(each, of) for each in eruptions] for of in ("weakening", "control"))

    def at_least(values: list[float]) -> dict[str, Any]:
        return {
            str(decades): share(sum(each >= decades for each in values), len(values)) for decades in RISES_IN_DECADES
        }

    return {
        "onsets": [_ends_of(mu, ramps) for mu in dict.fromkeys(end["mu"] for end in ramps)],
        "lowered": share(sum(decided), len(decided)),
        "lowered_unknown": len(undecided),
        "rises": at_least(rises),
        "control_rises": at_least(controls),
        "rise_quartiles": np.quantile(rises, QUARTILES).tolist() if rises else None,
        "control_rise_quartiles": np.quantile(controls, QUARTILES).tolist() if controls else None,
        "unstable_when_weakened": share(sum(each["rate"] > 0 for each in eruptions), len(eruptions)),
        "grows": share(sum(map(grows, eruptions)), len(eruptions)),
        "perturbation_shows": share(sum(each["perturbation_shows"] for each in eruptions), len(eruptions)),
    }


def in_words(numbers: dict[str, Any]) -> list[str]:
    """The summary as lines for a terminal."""
    return lines(__package__ or "", "triggering.j2", result=numbers)


def _ends_of(mu: float, ramps: Sequence[Row]) -> dict[str, Any]:
    ends = [each["ends"] for each in ramps if each["mu"] == mu]
    found = [each == "onset" for each in ends]
    return {
        "mu": mu,
        "found": share(sum(found), len(found)),
        "none_until": ends.count("until"),
        "flows": ends.count("flows"),
        "quartiles": quartiles([each["reach"] for each in ramps if each["mu"] == mu], found),
    }
