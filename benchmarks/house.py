"""How large each room of the code is: files, lines, and lines of code.

    python3 benchmarks/house.py

Lines of code are those that are neither blank nor comments, docstrings or imports.
"""

import ast
import subprocess
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PRODUCT = ("analysis", "assessment", "figures", "pywrap", "src", "studies")


def lines_of_code(text: str) -> int:
    """Lines of a file that do something."""
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        docstring = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if docstring or isinstance(node, ast.Import | ast.ImportFrom):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = enumerate(text.splitlines(), 1)
    return sum(
        number not in left_out and bool(line.strip()) and not line.strip().startswith("#") for number, line in lines
    )


def main() -> None:
    """Print the table."""
    files, lines, code = Counter[str](), Counter[str](), Counter[str]()
    listed = subprocess.run(["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split():
        first, *rest = name.split("/")
        if first not in (*PRODUCT, "tests", "research") or not (ROOT / name).is_file():
            continue
        text = (ROOT / name).read_text(encoding="utf-8")
        room = first if first in ("tests", "research") or len(rest) < 2 else f"{first}/{rest[0]}"
        for each in {room, first if first in ("tests", "research") else "product"}:
            files[each] += 1
            lines[each] += text.count("\n")
            code[each] += lines_of_code(text)
    print(f"{'room':28}{'files':>8}{'lines':>8}{'code':>8}")
    for each in sorted(files, key=lambda name: (name in ("product", "research", "tests"), name)):
        print(f"{each:28}{files[each]:8}{lines[each]:8}{code[each]:8}")


if __name__ == "__main__":
    main()
