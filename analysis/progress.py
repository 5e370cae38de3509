"""What a long computation is doing, in words: a function that works long reports, and a caller shows the reports.

Reports go to the innermost `show_progress` of the thread; without one, as in a process of a pool, to nobody.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Watch = Callable[[str], None]
"""Told in words what begins."""

_watch: ContextVar[Watch] = ContextVar("watch", default=lambda says: None)


def report_progress(says: str) -> None:
    """Pass on the words for a step that begins to the function that shows them."""
    _watch.get()(says)


@contextmanager
def show_progress(watch: Watch | None = None, what: str = "") -> Iterator[None]:
    """Show the steps reported inside, after a few words; with None, the function outside shows them."""
    beyond = watch or _watch.get()
    before = _watch.set(lambda says: beyond(what + says))
    try:
        yield
    finally:
        _watch.reset(before)
