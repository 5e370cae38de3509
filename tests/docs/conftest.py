"""Scripts of pages, run as their reader runs them."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def of_script(tmp_path: Path) -> Callable[..., str]:
    """Writes files into tmp_path, runs one of them with its words, and gives what it prints; it is to end well."""

    def run(*words: str, **blocks: str) -> str:
        for name, text in blocks.items():
            (tmp_path / name).write_text(text)
        done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, timeout=3600)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
