"""How results show themselves: a line in a terminal, a picture or a table in a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from .digits import with_uncertainty

if TYPE_CHECKING:
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


def windows_table(title: str, windows: Sequence[Window]) -> str:
    """An HTML table of windows of complex eigenvalues."""
    rows = {}
    for each in windows:
        end = "the end" if each.fx_end is None else f"{each.fx_end:.8g}"
        begin = f"from {with_uncertainty(each.fx_onset, each.error)}"
        rows[begin] = f"to {end}, lambda = {each.eigenvalue:.6g}, {each.kind}"
    return table(title, rows)


def table(title: str, rows: Mapping[str, str]) -> str:
    """An HTML table of two columns."""
    body = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(title)}</caption>{body}</table>"
