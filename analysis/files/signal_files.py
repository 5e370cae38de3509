"""Signals from files: two columns of numbers, or any format that ObsPy reads.

ObsPy comes with ``pip install "faultgouge[seismic]"`` and is imported only if the file is not a table of numbers. The
time of a record counts from its first sample, in seconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..responses.signals import Signal, SignalError
from .plain_file import open_plain, read_plain_text

BEGINNING_BYTES = 4096
"""Bytes at the beginning of a file that tell a table of numbers from a record."""


def read_signal(path: str | Path, channel: str | None = None) -> Signal:
    """A signal from a file.

    Parameters
    ----------
    path : str or Path
        Two columns, time and value, separated by spaces or a comma, with comments after #; or a record.
    channel : str, optional
        Which trace of a record with several: its id, as in BW.RJOB..EHZ, or the end of that.

    Raises
    ------
    SignalError
        If there is no such file, or it holds no signal.
    """
    path = Path(path)
    try:
        with open_plain(path) as stream:
            head = stream.read(BEGINNING_BYTES)
    except OSError as error:
        raise SignalError(f"{path} cannot be read ({error.strerror}): correct its name") from None
    try:
        if _is_table(head):
            if channel is not None:
                raise SignalError("a table of two columns has no channels: leave channel out")
            return _table(path)
        return _record(path, channel)
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


def write_table(signal: Signal, path: Path) -> None:
    """Write two columns with all digits, for fix addforce/signal."""
    np.savetxt(path, np.column_stack([signal.time, signal.value]), fmt="%.17g")


def _is_table(head: bytes) -> bool:
    """Whether the first line that is no comment begins with a number."""
    try:
        # the last line may be cut off, also within a letter
        lines = head.decode("ascii", "strict" if len(head) < BEGINNING_BYTES else "ignore").splitlines()
        words = next((words for line in lines if (words := line.split("#")[0].replace(",", " ").split())), [])
        float(words[0])
    except (UnicodeDecodeError, ValueError, IndexError):
        return False
    return b"\0" not in head


def _table(path: Path) -> Signal:
    rows = []
    for number, line in enumerate(read_plain_text(path).splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            time, value = (float(word) for word in words)
        except ValueError:
            raise SignalError(f"line {number} has something else than two numbers, time and value: mend it") from None
        rows.append((time, value))
    return Signal(*np.array(rows).T)


def _record(path: Path, channel: str | None) -> Signal:
    try:
        from obspy import read
    except ImportError:
        raise SignalError(
            'it is no table of two columns, and ObsPy, which reads records, is not installed: pip install "faultgouge'
            '[seismic]"'
        ) from None
    try:
        stream = read(str(path))
    except Exception as error:  # whatever the reader of the format raises on a broken file
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise SignalError(
            f"it is no table of two columns, and ObsPy cannot read it ({reason}): give another file"
        ) from None
    return of_trace(_choose_component(list(stream), channel))


def of_trace(trace: Any) -> Signal:
    """A trace of ObsPy as a signal whose time counts from its first sample, in seconds."""
    if np.ma.is_masked(trace.data):
        raise SignalError(f"the trace {trace.id} has gaps: fill them, or cut them off")
    return Signal(trace.times(), np.asarray(trace.data, dtype=np.float64))


def _choose_component(traces: list[Any], channel: str | None) -> Any:
    names = ", ".join(dict.fromkeys(trace.id for trace in traces))
    if channel is None:
        if len(traces) != 1:
            raise SignalError(f"it has the traces {names or 'none'}: name one of them with channel")
        return traces[0]
    found = [trace for trace in traces if trace.id.endswith(channel)]
    if len(found) != 1:
        says = "no trace" if not found else "more than one trace"
        raise SignalError(f'channel = "{channel}" fits {says} of {names}: name one of them')
    return found[0]
