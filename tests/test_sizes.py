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


def test_functions_of_cpp_are_told_from_scopes():
    text = "namespace a {\nstruct B {\n  int c() const\n  {\n    if (d) { e(); }\n    return 1;\n  }\n};\n}\n"
    assert [(name.split()[1], lines) for name, lines in cpp_functions(text)] == [("c()", 4)]


def too_long(path):
    """What is longer in a file than it may be."""
    text = path.read_text(encoding="utf-8")
    lines = len(text.splitlines())
    functions = python_functions(text) if path.suffix == ".py" else cpp_functions(text)
    return [("file", lines)] * (lines > 400) + [(name, lines) for name, lines in functions if lines > 40]


@pytest.mark.slow
def test_files_and_functions_are_short():
    paths = [*PYTHON, *CPP]
    assert len(paths) > 300
    assert {str(path.relative_to(ROOT)): found for path in paths if (found := too_long(path))} == {}
