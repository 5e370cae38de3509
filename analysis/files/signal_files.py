"""Signals from files: two columns of numbers, or any format that ObsPy reads.

ObsPy comes with ``pip install "faultgouge[seismic]"`` and is imported only if the file is not a table of numbers. The
time of a record counts from its first sample, in seconds.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import PackingFileError
from ..responses.signals import Signal, SignalError
from .atomic_write import read_plain, telling
from .formats.tables import columns_of, strip_comments


def read_signal(path: str | Path, channel: str | None = None) -> Signal:
    """A signal from a file of two columns, time and value, with spaces or a comma between them, and comments after #.

    Or from a record, of which `channel` is the id of a trace, as in BW.RJOB..EHZ, or the end of that. Raises
    SignalError if there is no such file, or it holds no signal.
    """
    path = Path(path)
    try:
        content = read_plain(path)
        rows = list(strip_comments(content.decode("ascii", "ignore").replace(",", " ").splitlines(), 1))
        # a table is text whose first line that is no comment begins with a number
        if b"\0" in content or not rows or not re.match(r"[-+]?\.?\d|[-+]?(nan|inf)", rows[0][1][0], re.IGNORECASE):
            return of_trace(_record(path, channel))
        if channel is not None:
            raise SignalError("a table of two columns has no channels: leave channel out")
        wanted = "two are needed, time and value"
        return Signal(*columns_of(path, rows, ("time", "value"), wanted, more=False).values())
    except OSError as error:
        raise SignalError(f"{path} cannot be read ({error.strerror}): correct its name") from None
    except PackingFileError as error:
        raise SignalError(str(error).rstrip(".")) from None
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


def write_table(signal: Signal, path: Path) -> None:
    """Write two columns with all digits, for fix addforce/signal."""
    np.savetxt(path, np.column_stack([signal.time, signal.value]), fmt="%.17g")


def _record(path: Path, channel: str | None) -> Any:
    """The trace of a record that is meant."""
    with telling(path, "is no table of two columns, and no record that pip install 'faultgouge[seismic]' reads"):
        from obspy import read

        traces = list(read(str(path)))
    found = [trace for trace in traces if channel is None or trace.id.endswith(channel)]
    if len(found) != 1:
        fits = "it has" if channel is None else f'channel = "{channel}" fits {len(found) or "none"} of'
        names = ", ".join(dict.fromkeys(trace.id for trace in traces)) or "none"
        raise SignalError(f"{fits} the traces {names}: name one of them with channel")
    return found[0]


def of_trace(trace: Any) -> Signal:
    """A trace of ObsPy as a signal whose time counts from its first sample, in seconds."""
    if np.ma.is_masked(trace.data):
        raise SignalError(f"the trace {trace.id} has gaps: fill them, or cut them off")
    return Signal(trace.times(), np.asarray(trace.data, dtype=np.float64))
