"""Fixes that may exert forces besides the contacts: by positions of particles, or on their velocities.

The motion of a packing shows whether a fix does so (:mod:`~faultgouge.pywrap.granular.motion_proof`). These lists only
explain a difference.
"""

from .granular_commands import MOBILE, WALLS, NotLinearisedError, without_suffix
from .look_in_a_copy import DRAG_STYLES, INSERTS, PER_STEP

PASSIVE = (
    *WALLS, *PER_STEP, *DRAG_STYLES, *INSERTS, *MOBILE, "gravity", "enforce2d", "slip/history", "low/parts",
    "dashpot/velocities", "keep/histories", "store", "property/atom",
)  # fmt: skip
"""Fixes, by the beginnings of their styles, whose action is in K, or constant, or none; so are those that LAMMPS makes
for itself, whose styles are in capitals (GRANULAR/MDR): styles of pairs need them."""

HOLDING = {
    "spring": "pulls at particles as contacts do not tell: leave it out",
    "indent": "pushes particles as contacts do not tell: leave it out",
}
"""Fixes that are refused where no motion is compared, and what is said of them."""

ACTING = HOLDING | {
    "smd": "pulls at particles as contacts do not tell: leave it out",
    "drag": "pulls at particles as contacts do not tell: leave it out",
    "addforce": "has a force that depends on the position or on velocities: make the force a constant",
    "accelerate/cos": "has a force that depends on the position: use fix gravity",
    "momentum": "changes velocities: unfix it",
    "temp/": "changes velocities: unfix it",
    "oneway": "changes velocities: unfix it",
    "recenter": "moves particles: unfix it",
}
"""Clauses on fixes, by the beginnings of their styles: without such a fix LAMMPS moves as K says."""


def acting_fixes(styles: dict[str, str]) -> dict[str, str]:
    """Fixes that may exert forces besides the contacts, by ID, with a clause on each."""
    found = {}
    for name, style in styles.items():
        plain = without_suffix(style)
        if plain.startswith(PASSIVE) or plain.isupper():
            continue
        says = [text for begin, text in ACTING.items() if plain.startswith(begin)]
        found[name] = f"fix {name} {style} {(says or ['acts on particles as contacts do not tell: unfix it'])[0]}"
    return found


def drag_remarks(styles: dict[str, str]) -> tuple[str, ...]:
    """A sentence on each fix, by ID, that takes energy away, and has no part in K and C."""
    drags = ((name, style) for name, style in styles.items() if without_suffix(style).startswith(DRAG_STYLES))
    return tuple(f"drag of fix {name} ({style}) is left out" for name, style in drags)


def check_holding(styles: dict[str, str]) -> None:
    """Refuse fixes that may hold, push or pull particles, where no motion can show whether they do."""
    held = {name: style for name, style in styles.items() if style.startswith(tuple(HOLDING))}
    for says in acting_fixes(held).values():
        raise NotLinearisedError(f"{says}.")
