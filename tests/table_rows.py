"""Tables of what is refused, as text: a line has the input, and the words of the sentence that name what is wrong."""

from pathlib import Path
from typing import Any

TESTS = Path(__file__).parent


def rows_of(table: str, **names: Any) -> list[tuple[Any, ...]]:
    """The rows of a table beside the tests, cells divided by " | ".

    A cell that begins with a brace or a bracket, or is a number, is a value of Python, with some names.
    """
    lines = (TESTS / table).read_text(encoding="utf-8").splitlines()
    rows = [line.split(" | ") for line in lines if line and not line.startswith("#")]
    return [
        tuple(eval(cell, names) if cell[0] in "{[" or cell.isdecimal() else cell for cell in row)  # our own text
        for row in rows
    ]
