"""Keep the last state of a deck whose packing cannot be taken, so that hours of a run are not lost.

A run of one step writes the restart file: in a file that `write_restart` writes after a run, LAMMPS leaves tangential
histories out.
"""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...analysis import Configuration, NoEquilibriumError
from .from_lammps import from_lammps
from .granular_commands import NotTakenError
from .instance_queries import styles_of
from .look_in_a_copy import INSERTS
from .relax import relax

MDR_HISTORY = "MDR_PARTICLE_HISTORY_VARIABLES"
"""ID of the fix by which LAMMPS keeps what particles of the model mdr remember."""

MDR_WALLS = "LAMMPS of 22 Jul 2025 crashes where a wall of the model mdr stands behind read_restart"


def take_or_keep(
    lmp: Any, commands: Iterable[str], keep: Path | None, *, slides: bool, balance: float, relaxes: bool
) -> Configuration:
    """What `from_lammps` takes, after `relax` if that is asked for; an error says where the state is kept, in a file
    beside `keep`, if that is given.

    Raises
    ------
    NotTakenError
        If the packing cannot be taken, or flows.
    """
    try:
        if relaxes:
            _relax(lmp, commands)
        return from_lammps(lmp, commands, slides=slides, balance=balance)
    except (NotTakenError, NoEquilibriumError) as error:
        longer = ", and with a longer run" if str(error).startswith("The packing moves") else ""
        raise NotTakenError(keep_state(lmp, str(error), keep, longer)) from error


def keep_state(lmp: Any, says: str, keep: Path | None, change: str) -> str:
    """A sentence on a deck, and where the state of the deck's runs is kept, if a restart file can be written beside
    `keep`; `change` is what the lines have to have besides."""
    lost = "Lost atoms" in says  # a restart file has no longer what LAMMPS has lost
    kept = None if keep is None or lost else _keep(lmp, keep.with_suffix(".restart"))
    if kept is None:
        return says
    where = f"{says.rstrip('.')}. The state is kept in {kept}"
    if MDR_HISTORY in lmp.available_ids("fix") and any("wall/gran" in each for each in styles_of(lmp).fixes.values()):
        return f"{where}, but {MDR_WALLS}."
    return (
        f"{where}: go on by a deck of read_restart {kept} and the lines of this deck from pair_style on, without those "
        f"that make particles{change}."
    )


def _relax(lmp: Any, commands: Iterable[str]) -> None:
    """Bring the particles that there are to rest, though the deck makes more of them, or has ended its run."""
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith((*INSERTS, "halt")):
            lmp.command(f"unfix {name}")
    lmp.command("timer timeout unlimited")
    relax(lmp, commands)


def _keep(lmp: Any, file: Path) -> Path | None:
    """Write a restart; None if LAMMPS cannot, if there is nothing to write, or there is such a file."""
    if file.exists() or lmp.get_natoms() == 0:
        return None
    with suppress(Exception):  # LAMMPS's bindings raise any error, and the first error is told
        for name in lmp.available_ids("dump"):  # one of which may have filled a disk
            lmp.command(f"undump {name}")
        lmp.command("timer timeout unlimited")
        lmp.command(f'restart 1 "{file.resolve()}.*"')
        lmp.command("run 1 post no")
        lmp.command("restart 0")
        written = sorted(file.parent.glob(f"{file.name}.*"))
        if written:
            written[-1].rename(file)
            return file
    return None
