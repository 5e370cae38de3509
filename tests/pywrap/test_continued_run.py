"""An undamped run that is cut off goes on from its last checkpoint, to the bit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Record, Scene, SceneError, perturb, reach
from faultgouge.pywrap.runs.undamped import sampling, weakening_of

REFERENCE = Path(__file__).parents[1] / "reference" / "packing7.json"


FORCED = {
    "cosine": {"amplitude": 1e-6, "omega": 3.0},
    "sweep": {"signal": "sweep", "amplitude": 1e-6, "omega": 3.0, "omega_end": 9.0},
    "moving floor": {"signal": "pulse", "on": "floor", "amplitude": 1e-6, "omega": 1.0},
}


def scene(precision, forced):
    return Scene.from_mapping(
        {
            "precision": precision,
            "packing": {"file": str(REFERENCE)},
            "law": {"kn": 2e5},
            "load": {"fy": 3.0},
            "perturb": {"fx": 1e-3, "time": 6.0, **FORCED[forced]},
            "friction": {"v0": 1e-9, "v_ss": 1e-6},
            "output": {"trajectory": True},
        }
    )


@pytest.mark.parametrize(
    ("precision", "forced"),
    [("double", "cosine"), ("compensated", "cosine"), ("double", "moving floor"), ("compensated", "sweep")],
)
@pytest.mark.slow
def test_it_goes_on_to_the_bit(precision, forced, tmp_path):
    wanted = scene(precision, forced)
    *_, start = reach(wanted, wanted.perturb.fx)
    weakening = weakening_of(wanted.friction, wanted.friction.v0)
    kept = []
    whole = list(perturb(wanted, start, weakening=weakening, keep=kept.append))
    dt, steps = sampling(wanted.perturb, start.packing)
    assert len(kept) >= 1
    assert min(sample.friction for sample in whole) < max(sample.friction for sample in whole)
    rest = list(perturb(wanted, start, weakening=weakening, resume=kept[0]))
    assert rest == whole[np.searchsorted(steps, kept[0].step, side="right") :]

    def first_part(path):
        with Record(path, wanted, task="perturb") as record:
            record.append(start)
            for sample in record.undamped(wanted, start, weakening=weakening):
                if sample.time > (kept[0].step + 1000) * dt:
                    break

    first_part(tmp_path / "run.h5")
    with RunFile(tmp_path / "run.h5") as file:
        assert file.checkpoint["step"] == kept[0].step
        assert not file.complete
    with Record(tmp_path / "run.h5", wanted, task="perturb") as record:
        assert list(record.undamped(wanted, record.last, weakening=weakening)) == whole
        record.finish()
    with RunFile(tmp_path / "run.h5") as file:
        assert file.checkpoint == {}
        assert file.complete
        assert file.series("undamped")["msd"].tolist() == [sample.msd for sample in whole]
        assert file.series("trajectory")["time"].tolist() == [sample.time for sample in whole]


def test_a_file_of_another_task_is_not_continued(tmp_path):
    wanted = scene("double", "cosine")
    *_, start = reach(wanted, wanted.perturb.fx)
    with Record(tmp_path / "run.h5", wanted) as record:
        record.append(replace(start))
    with pytest.raises(SceneError, match="is a file of the command ramp"):
        Record(tmp_path / "run.h5", wanted, task="perturb")
