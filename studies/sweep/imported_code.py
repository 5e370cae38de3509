"""The code of a Python file and of the modules of its own that it imports, as one digest.

The imports are read from the text, without running it, wherever in a file they stand: a module that only one function
imports counts. Comments, docstrings and layout do not count. Modules imported by a computed name, and data that a
program reads, are not found.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from pathlib import Path


def code_digest(file: Path, folder: Path, package: str | None = None) -> str:
    """Sixteen hexadecimal digits that stand for the code of a file and of what it imports, directly or not.

    Parameters
    ----------
    file : Path
        A Python file without errors of syntax.
    folder : Path
        The folder in which its own modules lie; those of other folders are not followed.
    package : str, optional
        The only package of this folder that is followed; by default all.
    """
    found: dict[str, str] = {}
    waiting = [file]
    while waiting:
        each = waiting.pop()
        name = str(each.relative_to(folder))
        if name in found:
            continue
        try:
            tree = ast.parse(each.read_bytes())
        except (SyntaxError, ValueError):  # a module that only some call imports, which will say so
            found[name] = each.read_bytes().hex()
            continue
        waiting += [path for at, names in _imports(tree, each, folder, package) for path in _files(at, names)]
        found[name] = _code(tree)
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()[:16]


def _code(tree: ast.Module) -> str:
    """Code without comments, docstrings and layout; changes the tree."""
    for node in ast.walk(tree):
        kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        if isinstance(node, kinds) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Pass()
    return ast.dump(tree)


def _imports(tree: ast.Module, file: Path, folder: Path, package: str | None) -> Iterator[tuple[Path, list[str]]]:
    """The modules that a file imports: a folder, and the names from there on."""
    for node in ast.walk(tree):
        dotted = []
        at = folder
        if isinstance(node, ast.Import):
            dotted = [each.name.split(".") for each in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module.split(".") if node.module else []
            dotted = [[*base, each.name] for each in node.names]
            if node.level:
                at = file.parents[node.level - 1]
        if at == folder and package is not None:
            dotted = [names for names in dotted if names[0] == package]
        yield from ((at, names) for names in dotted if at.is_relative_to(folder))


def _files(folder: Path, names: list[str]) -> Iterator[Path]:
    """The files that an import of a.b.c runs: of a, of a.b, and of a.b.c."""
    for name in names:
        for path in (folder / f"{name}.py", folder / name / "__init__.py"):
            if path.is_file():
                yield path
        folder /= name
