"""A study is one file: the example of the page is a command, a section of a scene and a file of results."""

import json
import re
from functools import cache
from pathlib import Path

import pytest
from reference_layer import SMALL, toml

import faultgouge.studies
from faultgouge import registered
from faultgouge.commands import program
from faultgouge.pywrap import Scene, SceneError

ROOT = Path(__file__).parents[2]


def test_the_study_of_the_page_is_a_command_and_a_section(tmp_path, monkeypatch, capsys):
    (text,) = re.findall(r"```py\n(\"\"\"How many contacts.*?)```", (ROOT / "docs" / "howto.md").read_text(), re.DOTALL)
    folder, scene = tmp_path / "studies", SMALL | {"strong": {"share": 0.3}}
    folder.mkdir()
    (folder / "strong.py").write_text(text)
    monkeypatch.setattr(registered, "FOLDER", folder)
    monkeypatch.setattr(faultgouge.studies, "__path__", [*faultgouge.studies.__path__, str(folder)])
    monkeypatch.setattr(registered, "description", cache(registered.description.__wrapped__))
    says = program().commands["strong"].help
    assert says.startswith("Count the contacts that carry more than a share of the largest normal force.")
    (tmp_path / "scene.toml").write_text(toml(scene))
    monkeypatch.chdir(tmp_path)
    program()(["strong", "scene.toml", "-o", "out", "--json"], standalone_mode=False)
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "out" / "strong.json").read_text())
    assert printed["scene"]["strong"] == {"share": 0.3}
    assert 0 < printed["contacts"] < printed["of"]
    for command in ("strong", "settle", None):  # also where the section is not read
        with pytest.raises(SceneError, match=r"strong\.shares is no key of \[strong\]: the nearest is strong\.share"):
            Scene.from_mapping(scene | {"strong": {"shares": 0.3}}, command=command)
    with pytest.raises(SceneError, match=r"strong\.share = -1\.0 is refused: it should be greater than 0"):
        Scene.from_mapping(scene | {"strong": {"share": -1.0}}, command="strong")
    with pytest.raises(SceneError, match="stron is no key of a scene: the nearest is strong"):
        Scene.from_mapping(SMALL | {"stron": {}}, command="settle")


def test_no_study_is_named_outside_of_its_file():
    """In the code of the package; research and pages are users of a study. The waves of `trigger` begin with the growth
    rates that `eruptions` has."""
    folders = ("analysis", "assessment", "figures", "pywrap", "src/faultgouge", "studies")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.py") if path.stem != "eruptions"]
    named = [path.name for path in paths if re.search(r"[\"'.\[]eruptions\b", path.read_text(encoding="utf-8"))]
    assert sorted(set(named)) == ["trigger.py"]
