"""Results that display themselves as a table, in a terminal and in a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


class TableDisplay:
    """A result that shows itself as a table of two columns: in a notebook, and when rich prints it."""

    def _rows(self) -> Mapping[str, str]:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        body = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
            for name, value in self._rows().items()
        )
        return f"<table><caption>{html.escape(repr(self).strip('<>'))}</caption>{body}</table>"

    def __rich__(self) -> Table:
        from rich.table import Table

        table = Table("", "", title=repr(self).strip("<>"), show_header=False, title_justify="left")
        for name, value in self._rows().items():
            table.add_row(name, value)
        return table
