"""A packing under shear with slips, and the command."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import Packing, RunFile
from faultgouge.pywrap import Engine, Equilibrium, equilibrate

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def sheared(reference_packing) -> Packing:
    """The reference packing in equilibrium under shear, with masses and angles of its own."""
    packing = reference_packing(1.0)
    with Engine(packing) as engine:
        found = equilibrate(engine, Equilibrium(packing, packing.residual, 0.0, 0), 0.01).packing
    rng = np.random.default_rng(1)
    n = len(packing)
    return replace(found, mass=rng.uniform(0.5, 2, n), angle=rng.normal(size=n), inertia_factor=0.5, drag_time=10.0)


@pytest.fixture
def stored(tmp_path, sheared) -> Path:
    """The packing as a run.h5."""
    with RunFile.create(tmp_path / "run.h5", sheared) as file:
        file.append(sheared)
        file.complete = True
    return tmp_path / "run.h5"


@pytest.fixture
def refusal(faultgouge_here) -> Callable[..., str]:
    """Runs a command that is refused in one sentence, and gives the sentence."""

    def run(*words: object, code: int = 2) -> str:
        done = faultgouge_here(*words, code=code)
        assert len(done.stderr.strip().splitlines()) == 1
        return done.stderr

    return run
