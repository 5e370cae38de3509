"""Pages that a study leaves: a Jinja template, which has the prose, filled with the numbers of the study."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined

from ..analysis.digits import with_uncertainty


def render(package: str, name: str, **numbers: Any) -> str:
    """A page in Markdown.

    Parameters
    ----------
    package : str
        The package whose folder has the template: `__package__`.
    name : str
        File name of the template. In it, ``{{ x | number(".3g") }}`` formats a number as Python does, and
        ``{{ x | uncertain(error) }}`` gives it the digits that its error allows.
    **numbers
        What the template names; a name that is missing is an error.
    """
    folder = files(package)
    environment = Environment(
        loader=FunctionLoader(lambda template: (folder / template).read_text()),
        undefined=StrictUndefined,
        autoescape=False,  # Markdown, not HTML
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = format
    environment.filters["uncertain"] = with_uncertainty
    return environment.get_template(name).render(**numbers)
