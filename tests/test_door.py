"""What `import faultgouge` offers."""

import importlib
import re

import pytest

import faultgouge
from faultgouge.analysis import BadInputError, Packing, RunFile


def test_every_name_that_is_offered_is_there():
    for name, module in faultgouge.OFFERS.items():
        assert getattr(faultgouge, name) is getattr(importlib.import_module(f"faultgouge.{module}"), name)
        assert name in dir(faultgouge)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = faultgouge.nothing


def test_onset_of_a_scene_prints_as_the_command_does(tmp_path):
    scene = faultgouge.Scene.from_mapping(
        {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-3, "until": 0.02}}
    )
    found = faultgouge.onset(scene)
    assert found.fx_c == pytest.approx(0.01500983227, abs=3e-11)
    assert re.fullmatch(r"F_x\^c = 0\.0150098322\d*\(\d+\)", str(found))


def test_load_takes_files_of_all_kinds(tmp_path, cluster_file):
    packing = faultgouge.load(cluster_file)
    assert isinstance(packing, Packing)
    with pytest.raises(BadInputError, match="faultgouge import"):
        faultgouge.load(tmp_path / "table.csv")


@pytest.fixture
def cluster_file(tmp_path):
    from faultgouge.analysis import Contacts, MindlinLaw

    packing = Packing(
        position=[[0.0, 0.49]], radius=[0.5], contacts=Contacts([0], [-1], [0.0]), law=MindlinLaw(2e3, 6e2, 0.5)
    )
    with RunFile.create(tmp_path / "run.h5", packing) as file:
        file.append(packing)
        file.complete = True
    return tmp_path / "run.h5"
