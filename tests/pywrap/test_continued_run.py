"""An undamped run that is cut off goes on from its last checkpoint, to the bit."""

import numpy as np
import pytest
from reference_layer import REFERENCE

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Record, Scene, SceneError, perturb, reach
from faultgouge.pywrap.runs.undamped import sampling, weakening_of

COSINE = {"amplitude": 1e-6, "omega": 3.0}
FORCED = {
    "cosine": COSINE,
    "cosine, compensated": COSINE,
    "cosine, damped": COSINE,
    "sweep, compensated": {"signal": "sweep", "amplitude": 1e-6, "omega": 3.0, "omega_end": 9.0},
    "moving floor": {"signal": "pulse", "on": "floor", "amplitude": 1e-6, "omega": 1.0},
}


def scene(kind):
    damping = {"damping": {"cn": 30.0, "ct": 20.0, "tau": 0.2}} if "damped" in kind else {}
    return Scene.from_mapping(
        {
            "precision": "compensated" if "compensated" in kind else "double",
            "packing": {"file": str(REFERENCE)},
            "law": {"kn": 2e5},
            "load": {"fy": 3.0},
            "perturb": {"fx": 1e-3, "time": 6.0, **FORCED[kind]},
            "friction": {"v0": 1e-9, "v_ss": 1e-6},
            "output": {"trajectory": True},
            **damping,
        }
    )


@pytest.mark.parametrize("kind", FORCED)
@pytest.mark.slow
def test_it_goes_on_to_the_bit(kind, tmp_path):
    wanted = scene(kind)
    *_, start = reach(wanted, wanted.perturb.fx)
    weakening = weakening_of(wanted.friction, wanted.friction.v0)
    kept = []
    whole = list(perturb(wanted, start, weakening=weakening, keep=kept.append))
    dt, steps = sampling(wanted.perturb, start.packing)
    assert len(kept) >= 1
    assert min(sample.friction for sample in whole) < max(sample.friction for sample in whole)
    rest = list(perturb(wanted, start, weakening=weakening, resume=kept[0]))
    assert rest == whole[np.searchsorted(steps, kept[0].step, side="right") :]

    with Record(tmp_path / "run.h5", wanted, task="perturb") as record:
        record.append(start)
        for sample in record.undamped(wanted, start, weakening=weakening):
            if sample.time > (kept[0].step + 1000) * dt:
                break
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
    wanted = scene("cosine")
    *_, start = reach(wanted, wanted.perturb.fx)
    with Record(tmp_path / "run.h5", wanted) as record:
        record.append(start)
    with pytest.raises(SceneError, match="is a file of the command ramp"):
        Record(tmp_path / "run.h5", wanted, task="perturb")
