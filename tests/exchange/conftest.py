"""A packing under shear with slips, as a run.h5 too, and the formats that have all of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import Packing, RunFile
from faultgouge.pywrap import Engine, Equilibrium, equilibrate


@pytest.fixture(params=[".xyz", ".data", ".gsd"])
def suffix(request) -> str:
    """Formats that come back to the bit."""
    if request.param == ".gsd":
        pytest.importorskip("gsd", reason="GSD needs the extra export: pip install 'faultgouge[export]'")
    return request.param


@pytest.fixture(scope="session")
def equilibria(reference_packing) -> tuple[Packing, Packing]:
    """The reference packing with masses and angles of its own, without shear and with it."""
    packing, rng = reference_packing(1.0), np.random.default_rng(1)
    own = {"mass": rng.uniform(0.5, 2, len(packing)), "angle": rng.normal(size=len(packing))}
    start = replace(packing, **own, inertia_factor=0.5, drag_time=10.0)
    with Engine(start) as engine:
        return start, equilibrate(engine, Equilibrium(start, start.residual, 0.0, 0), 0.01).packing


@pytest.fixture
def sheared(equilibria) -> Packing:
    return equilibria[1]


@pytest.fixture
def ramp(tmp_path, equilibria) -> Path:
    """Both equilibria as a run.h5."""
    with RunFile.create(tmp_path / "run.h5", equilibria[0]) as file:
        for packing in equilibria:
            file.append(packing)
        file.complete = True
    return tmp_path / "run.h5"
