"""Pages of studies: a Jinja template with the text, filled with the numbers of the study."""

from __future__ import annotations

import re
import textwrap
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined

from ..analysis.uncertain_digits import with_uncertainty

PROSE_WIDTH = 118
"""Characters of a line of prose."""

PROSE = r"(?![|#<$!]|```| {4}|\s*$)"
PARAGRAPH = re.compile(rf"^{PROSE}(- |\d+\. )?.+\n?(?:{PROSE}(?!- |\d+\. ).+\n?)*", re.MULTILINE)
"""Lines of prose, or of an item of a list: no tables, headings, tags, formulas, pictures, code."""

NO_BEGINNING = re.compile(r" (?=(?:[-+*>#=]|\d+[.)]) )")
"""The blank before a word that would make a list, a quotation or a heading of the line that begins with it."""


def render(package: str, name: str, **numbers: Any) -> str:
    """Fill the template of a page.

    Parameters
    ----------
    package : str
        The package whose folder has the template: `__package__`.
    name : str
        File name of the template. In it, ``{{ x | number(".3g") }}`` formats a number as Python does, and
        ``{{ x | uncertain(error) }}`` gives it the digits that its error allows.
    **numbers
        The values of the names in the template; a missing name is an error.

    Returns
    -------
    str
        The page in Markdown, its paragraphs filled.
    """
    return fill_paragraphs(filled(package, name, numbers))


def lines(package: str, name: str, **numbers: Any) -> list[str]:
    """Lines for a terminal, as wide as they are; arguments as of `render`."""
    return [line for line in filled(package, name, numbers).splitlines() if line]


def filled(package: str, name: str, numbers: dict[str, Any], autoescape: bool = False) -> str:
    """A template of the folder of a package, filled; `autoescape` if it is HTML, and not Markdown."""
    loader = FunctionLoader(lambda template: (files(package) / template).read_text(encoding="utf-8"))
    how: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    environment = Environment(loader=loader, undefined=StrictUndefined, autoescape=autoescape, **how)
    environment.filters["number"] = format
    environment.filters["uncertain"] = with_uncertainty
    return environment.get_template(name).render(**numbers)


def fill_paragraphs(text: str) -> str:
    """A page whose paragraphs are as wide as a screen at the most; blocks of code and formulas stay as they are."""

    def fill(found: re.Match[str]) -> str:
        mark = found[1] or ""
        words = NO_BEGINNING.sub("\0", " ".join(found[0][len(mark) :].split()))
        lines = textwrap.fill(words, PROSE_WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark),
                              break_long_words=False, break_on_hyphens=False)  # fmt: skip
        return lines.replace("\0", " ") + "\n" * found[0].endswith("\n")

    parts = re.split(r"^((?:```|\$\$).*?^(?:```|\$\$)$)", text, flags=re.MULTILINE | re.DOTALL)
    parts[::2] = [PARAGRAPH.sub(fill, part) for part in parts[::2]]
    return "".join(parts)
