"""Why nothing can be said about the motion of a configuration, whatever its eigenvalues are."""

from collections.abc import Iterator

from ..configuration import UNKNOWN_SLIPS, Configuration
from ..counted import counted
from .eigenvalues import in_balance


def no_verdict(configuration: Configuration) -> Iterator[str]:
    """Sentences without a stop; none where a verdict is possible."""
    if not configuration.slips_known:
        yield UNKNOWN_SLIPS
    sided = configuration.one_sided_particles
    if len(sided):
        named = ", ".join(map(str, configuration.ids[sided[:5]])) + (", ..." if len(sided) > 5 else "")
        forces = f"the forces on {counted(len(sided), 'particle')} ({named})"
        where = "as where sliding, rolling or twisting friction is at its bound or a contact is about to open"
        both = "and K by differences of forces is the mean of both"
        yield f"{forces} have other derivatives forwards than backwards, {where}, {both}"
    if not in_balance(configuration):
        largest = f"the largest force of a contact or a wall {configuration.largest_force:.3g}"
        yield f"the packing moves: the residual force on a particle is {configuration.residual:.3g}, {largest}"
