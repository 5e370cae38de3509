"""Measured laws beside the numbers of their commands: a remark where LAMMPS does otherwise than its line says.

LAMMPS's manual says what the numbers of a line are: k_n of f_n = k_n (R delta)^q delta and k_t of k_t' = k_t (R
delta)^q, with q = 0 for hooke and linear_history, and q = 1/2 for hertz and mindlin. A release may do otherwise: the
wall of fix wall/gran hooke/history of 22 Jul 2025 has q = 1/2 along its surface.
"""

import re

import numpy as np

from .contact_law_measurement import MeasuredLaw, PowerOfOverlap, State
from .granular_commands import Commands, without_suffix

LAW_DIFFERENCE = 0.01
"""Relative difference from which on a number is remarked."""

NAMES_OF_NUMBERS = {
    "stiffness": "a normal stiffness",
    "tangential": "a tangential stiffness",
    "mu": "a friction coefficient",
}
"""Names of the numbers in sentences."""


def remark_on(law: MeasuredLaw, commands: Commands, name: tuple[int, int] | str, state: State) -> str | None:
    """A sentence on what a law has of other numbers than its line, at a state; None if it has the same."""
    line = _line_of(commands, name)
    if line is None:
        return None
    who = f"fix {name}" if isinstance(name, str) else f"Contacts of types {name[0]} and {name[1]}"
    radius, overlap = np.array(state.radius), np.array(state.overlap)
    says = []
    for what, said in _said(line).items():
        if what == "tangential" and law.mu == 0:
            continue  # without friction there is no tangential force
        measured = law.mu if isinstance(said, float) else float(getattr(law, what).at(radius, overlap))
        given = said if isinstance(said, float) else float(said.at(radius, overlap))
        if given > 0 and abs(measured / given - 1) > LAW_DIFFERENCE:
            says.append(f"{NAMES_OF_NUMBERS[what]} {measured / given:.3g} times that of the line")
    return f"{who}: LAMMPS has {' and '.join(says)} {' '.join(line)!r}, and K has LAMMPS's" if says else None


def _line_of(commands: Commands, name: tuple[int, int] | str) -> list[str] | None:
    """Words of the line that has the numbers of a law, from the style on; None if LAMMPS mixes them."""
    if isinstance(name, str):
        return commands.fixes[name].split()[4:]
    words = commands.pair[0].split()[1:]
    if words[0].startswith("hybrid"):
        return None
    if without_suffix(words[0]) != "granular":
        return words
    lines = [line.split()[1:] for line in commands.pair[1:]]
    found = [line[2:] for line in lines if all(_has_type(word, kind) for word, kind in zip(line, name, strict=False))]
    return ["granular", *found[-1]] if found and (name[0] == name[1] or len(lines) == 1) else None


def _has_type(word: str, kind: int) -> bool:
    """Whether a type, or a range as 2*4, of pair_coeff has a type."""
    low, star, high = word.partition("*")
    return word == str(kind) if not star else int(low or 1) <= kind <= int(high or kind)


def _said(words: list[str]) -> dict[str, PowerOfOverlap | float]:
    """The numbers of a line: stiffnesses and friction, as far as they stand there."""
    style = without_suffix(words[0]).removeprefix("gran/")
    if style in ("hooke/history", "hertz/history"):
        q, (kn, kt, _, _, mu) = 0.5 if style.startswith("hertz") else 0.0, words[1:6]
        tangential = 2 / 7 * float(kn) if kt == "NULL" else float(kt)
        return {"stiffness": PowerOfOverlap(float(kn), q), "tangential": PowerOfOverlap(tangential, q), "mu": float(mu)}
    found: dict[str, PowerOfOverlap | float] = {}
    if style != "granular":
        return found
    if words[1] in ("hooke", "hertz"):
        found["stiffness"] = PowerOfOverlap(float(words[2]), 0.5 if words[1] == "hertz" else 0.0)
    if "tangential" in words:
        model, kt, _, mu = words[words.index("tangential") + 1 :][:4]
        q = 0.5 if model.startswith("mindlin") else 0.0
        if re.fullmatch(r"[-+.\deE]+", kt) and "classic" not in model:
            found["tangential"] = PowerOfOverlap(float(kt), q)
        found["mu"] = float(mu)
    return found
