"""Results as tables, in a terminal and in a notebook."""

import html
from collections.abc import Iterable, Mapping


class TableDisplay:
    """A result that shows itself in a notebook as a table of two columns."""

    def _rows(self) -> Mapping[str, str]:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        rows = ((html.escape(name), html.escape(value)) for name, value in self._rows().items())
        body = "".join(f"<tr><th style='text-align:left'>{name}</th><td>{value}</td></tr>" for name, value in rows)
        return f"<table><caption>{html.escape(repr(self).strip('<>'))}</caption>{body}</table>"


def table_of(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table as lines of text; a column is as wide as its widest entry.

    >>> print(table_of(("load", "pairs"), [("0.1", "2"), ("0.25", "13")]))
    load   pairs
    0.1    2
    0.25   13
    """
    lines = [list(headings), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("   ".join(map(str.ljust, line, widths)).rstrip() for line in lines)
