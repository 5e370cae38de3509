"""Which swept keys make another packing of each seed.

Settling is chaotic: it amplifies the last digit of its load and of its stiffness. A seed therefore stands for one
packing at one ratio of k_n to F_y alone (in any units, see :func:`~faultgouge.pywrap.settling.settle.own_units`), and a
sweep over load.fy or law.kn compares packings that have only their loose start in common; with `settle_friction`, so
does a sweep over friction. Packings that settle at a load of reference (`settle_at`) and are carried to other loads
remain one packing. Stored packings have no seed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from ...pywrap import Scene
from ...pywrap.scenes.packing_section import GeneratedPacking
from ...pywrap.settling.settle import law_of, settling_units
from .sweep_plan import Sweep, digest


def other_packings(sweep: Sweep) -> str | None:
    """A sentence that names the swept keys by which a seed is another packing at each value; None without any."""
    keys = [name for name in sweep.names if name.split(".")[0] in ("load", "law", "units")]
    if not keys or not _seeds_settle_otherwise(point.scene for point in sweep.points if point.scene is not None):
        return None
    return (
        f"{', '.join(keys)}: settling is chaotic, so that a seed is another packing at each value, and differences "
        "between values are those of packings, too: compare many seeds, or settle at one load with packing.settle_at"
    )


def _seeds_settle_otherwise(scenes: Iterable[Scene]) -> bool:
    """Whether two scenes with the same loose start settle by other numbers."""
    settled = defaultdict(set)
    for scene in scenes:
        if isinstance(scene.packing, GeneratedPacking):
            law = law_of(scene, scene.law.mus[0])
            section, own, fy = settling_units(scene, law)
            # without friction nothing of the law but k_n and its exponent has a part in settling
            numbers = own if scene.packing.settle_friction else (own.kn, own.exponent)
            settled[digest(section.model_dump())].add(digest([str(numbers), fy]))
    return any(len(each) > 1 for each in settled.values())
