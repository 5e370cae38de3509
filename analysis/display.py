"""How results show themselves: a line in a terminal, a picture or a table in a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from .digits import with_uncertainty

if TYPE_CHECKING:
    from rich.table import Table

    from .onset import Window
    from .packing import Packing


def packing_line(packing: Packing) -> str:
    """What a packing is, in one line."""
    box = "open sides" if packing.box_length is None else f"period {packing.box_length:g}"
    load = f"fx = {packing.fx:g}, fy = {packing.fy:g}"
    digits = ", compensated" if packing.compensated else ""
    return (
        f"<Packing: {len(packing)} disks, {len(packing.contacts)} contacts, {int(packing.top.sum())} in the upper "
        f"layer, {box}, mu = {packing.law.mu:g}, {load}{digits}>"
    )


def packing_picture(packing: Packing) -> bytes | None:
    """The packing as a PNG; None where matplotlib is not installed.

    The one place at which `analysis` reaches for `figures`: for notebooks, and when a notebook asks.
    """
    try:
        from faultgouge.figures import draw_packing
    except ImportError:
        return None
    from io import BytesIO

    stream = BytesIO()
    draw_packing(packing).savefig(stream, format="png", dpi=150)
    return stream.getvalue()


class Tabled:
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


def windows_rows(windows: Sequence[Window]) -> dict[str, str]:
    """Windows of complex eigenvalues in words: where each begins, and what it is."""
    rows = {}
    for each in windows:
        end = "the end" if each.fx_end is None else f"{each.fx_end:.8g}"
        begin = f"from {with_uncertainty(each.fx_onset, each.error)}"
        rows[begin] = f"to {end}, lambda = {each.eigenvalue:.6g}, {each.kind}"
    return rows
