"""The command with an engine that fails: `python failing_engine.py CALL RANK WORD ...`."""

import sys
from itertools import count

from faultgouge import signal_guard
from faultgouge.cli import main
from faultgouge.pywrap import Engine, EngineError


def failing(call, rank=-1):
    """`Engine.try_displacement` that fails at a call, on one rank or, with -1, on all."""
    calls, works = count(1), Engine.try_displacement

    def fails(self, *arguments):
        if next(calls) == call and rank in (-1, signal_guard.rank()):
            raise EngineError(f"LAMMPS stopped: it was told to at call {call}.")
        return works(self, *arguments)

    return fails


if __name__ == "__main__":
    Engine.try_displacement = failing(*(int(sys.argv.pop(1)) for _ in range(2)))
    main()
