"""Numbers in what a script or a command prints."""

import re


def number(text, before):
    """The number after some words."""
    return float(re.search(re.escape(before) + r" *(-?\d[-+.\de]*)", text)[1])
