"""Bodies of fix rigid that translate and do not rotate, by the words of their lines.

Such a body is a lid: its particles have one displacement, and the force on the body is the sum of theirs. LAMMPS gives
the dashpots at these particles the mass of the body, so that the fix has to stay where forces are measured. There it
holds the velocity of each body (`HELD`), which the body takes from its particles at the beginning of a run.
"""

from typing import NamedTuple

from .granular_commands import BODIES, NotTakenError, without_suffix

HELD = "force * off off off torque * off off off"
"""Words by which a body keeps its velocity, whatever its particles feel."""


class Body(NamedTuple):
    """A group of particles that translate as one, along some of the axes."""

    group: str
    axes: tuple[bool, bool, bool]


def translating_bodies(line: str, dimension: int) -> list[Body]:
    """The bodies of a command fix rigid.

    Raises
    ------
    NotTakenError
        If they may rotate, or the command has what is not known here.
    """
    words = line.split()
    name, style = words[1], words[3]
    if without_suffix(style) not in BODIES:
        raise NotTakenError(f"fix {name} {style} {WAY_OUT}.")
    if words[4] == "single":
        groups, at = [words[2]], 5
    elif words[4] == "group":
        at = 6 + int(words[5])
        groups = words[6:at]
    else:
        raise NotTakenError(f"fix {name} {style} {words[4]} {WAY_OUT}.")
    axes, turns = ([[True] * 3 for _ in groups] for _ in range(2))
    while at < len(words):
        if words[at] == "reinit" and words[at + 1] in ("yes", "on", "true"):
            at += 2
            continue
        if words[at] not in ("force", "torque"):
            raise NotTakenError(
                f"fix {name} {style} has {' '.join(words[at : at + 2])}, which is not known here: leave it out."
            )
        moves = axes if words[at] == "force" else turns
        for k in _bodies_of(words[at + 1], len(groups)):
            moves[k] = [word in ("on", "yes", "true") for word in words[at + 2 : at + 5]]
        at += 5
    if any(any(each if dimension == 3 else each[2:]) for each in turns):
        raise NotTakenError(f"fix {name} {style} {words[4]} {WAY_OUT}.")
    return [Body(group, (x, y, z)) for group, (x, y, z) in zip(groups, axes, strict=True)]


WAY_OUT = (
    "holds particles together in bodies that may rotate, and rotations of bodies are not linearised here: for lids "
    "that do not rotate use fix rigid single, or group, with `torque * off off off` at the end of its line"
)


def _bodies_of(word: str, count: int) -> range:
    """Indices of the bodies that a number, or a range as 2*4, stands for."""
    low, star, high = word.partition("*")
    return range(int(low or 1) - 1, int(high or count) if star else int(low))
