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
SCOPE = re.compile(r"\b(namespace|class|struct|enum|union)\b[^()]*$")


def python_functions(text):
    """Name and lines of every function."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            words = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) is not None else 0
            yield node.name, node.end_lineno - node.lineno + 1 - words


def cpp_functions(text):
    """Head and lines of every function: braces that follow parentheses, outside of other functions."""
    bare = re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', lambda found: "\n" * found[0].count("\n"), text, flags=re.S)
    line, head, open_braces = 1, "", []
    for character in bare:
        line += character == "\n"
        if character == "{":
            inside = any(function for *_, function in open_braces)
            open_braces.append((line, head.strip(), "(" in head and not SCOPE.search(head) and not inside))
        elif character == "}":
            start, name, function = open_braces.pop()
            if function:
                yield name, line - start + 1
        head = "" if character in "{};" else head + character


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
    assert of_cpp > 200  # told from scopes
    assert long == []
