"""No file over 400 lines, no function over 40: the docstring is not counted."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = (
    "analysis",
    "pywrap",
    "figures",
    "studies",
    "assessment",
    "src/faultgouge",
    "tests",
    "benchmarks",
    "fuzz",
    "docs",
)
PYTHON = sorted({path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py") if "_build" not in path.parts})
CPP = sorted([*(ROOT / "pair_mindlin_smooth").glob("*.[ch]*"), *(ROOT / "analysis").rglob("*.cpp")])
BODY = re.compile(r"^([^\n]*)\n( *)\{\n.*?^\2\}", re.MULTILINE | re.DOTALL)
"""Of a function of C++ with its head: .clang-format begins a line with the brace of a function, and no other."""


def python_functions(text):
    """Name and lines of every function."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            words = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) is not None else 0
            yield node.name, node.end_lineno - node.lineno + 1 - words


def cpp_functions(text):
    """Head and lines of every function whose body has lines of its own."""
    return [(body[1], body[0].count("\n")) for body in BODY.finditer(text)]


@pytest.mark.slow
def test_files_and_functions_are_short():
    long, of_cpp = [], 0
    for path in [*PYTHON, *CPP]:
        text = path.read_text(encoding="utf-8")
        functions = [*(python_functions(text) if path.suffix == ".py" else cpp_functions(text))]
        long += [(path.name, name, lines) for name, lines in functions if lines > 40]
        if len(text.splitlines()) > 400:
            long.append((path.name, "file"))
        if path in CPP:
            of_cpp += len(functions)
    assert len(PYTHON) > 300
    assert of_cpp > 200
    assert long == []
