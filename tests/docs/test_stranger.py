"""What a stranger does: installs the sources into a fresh environment, once and with an extra, and tries what README
and the help of each command show, each in an empty folder."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = re.compile(r"Examples?: (.*)", re.DOTALL)

pytestmark = [pytest.mark.long, pytest.mark.ranks]


@pytest.fixture(scope="module")
def environment():
    """Of a shell that has the fresh environment alone, and none of these sources on Python's path."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return kept | {"OMP_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def installed(tmp_path_factory, environment):
    """The fresh environment, and what pip printed of the two installations."""
    clone, fresh = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("stranger") / "fresh"
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    for name in filter(lambda name: os.path.lexists(ROOT / name), names):
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, clone / name, follow_symlinks=False)
    subprocess.run([sys.executable, "-m", "venv", fresh], check=True)
    printed = []
    for what in (".", ".[movie,export]"):
        command = [fresh / "bin" / "pip", "install", "--verbose", what]
        into = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        done = subprocess.run(command, cwd=clone, env=environment, timeout=1800, **into)
        assert done.returncode == 0, done.stdout[-3000:]
        printed.append(done.stdout)
    return fresh, printed


def test_an_extra_does_not_compile_the_plugin_again(installed):
    fresh, (first, second) = installed
    compiled = [text.count("Building CXX object") for text in (first, second)]
    assert compiled[0] > 3
    assert compiled[1] == 0
    subprocess.run([fresh / "bin" / "python", "-I", "-c", "import gsd, imageio_ffmpeg"], check=True)


def test_readme_shows_what_its_commands_print(installed, environment, tmp_path):
    command = [installed[0] / "bin" / "python", ROOT / "docs" / "run_page.py", ROOT / "README.md", tmp_path]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1800)
    assert done.stdout == "the page is right\n", done.stdout + done.stderr


def test_the_examples_of_help_run(installed, environment, tmp_path):
    environment = environment | {"PATH": f"{installed[0] / 'bin'}:{environment['PATH']}"}

    def shell(line, folder):
        words = {"capture_output": True, "text": True, "timeout": 1800}
        return subprocess.run(["bash", "-c", line], cwd=folder, env=environment, **words)

    overview = shell("faultgouge --help", tmp_path).stdout.split("Commands:")[1]
    commands = re.findall(r"^  (\w+)  ", overview, re.MULTILINE)
    assert len(commands) > 20
    wrong = []
    for command in ["", *commands]:
        shown = " ".join(EXAMPLES.search(shell(f"faultgouge {command} --help", tmp_path).stdout)[1].split())
        for k, example in enumerate(shown.split("; ") if not command else [shown]):
            (folder := tmp_path / f"{command}{k}").mkdir()
            done = shell(example, folder)
            if done.returncode or "Error" in done.stderr:
                wrong.append(f"{example}: {done.stderr[-300:]}")
    assert wrong == []
