"""What is said of run.h5 is what the stored file holds, at whatever line of the writing an interrupt comes.

An undamped run that is cut off goes on from its last checkpoint, to the bit.
"""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference_layer import REFERENCE

from faultgouge.analysis import RunFile
from faultgouge.analysis.files import runfile
from faultgouge.pywrap import Equilibrium, Record, Scene, SceneError, perturb, reach, settle
from faultgouge.pywrap.runs import undamped
from faultgouge.pywrap.runs.undamped import sample_steps, weakening_of

SCENE = {"packing": {"file": str(REFERENCE)}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
WRITERS = {"run_recorder.py", "runfile.py", "atomic_write.py"}


def interrupted_at(number, work):
    """Whether work came to its n-th line in the files that write, where it was interrupted."""
    lines = iter(range(number))

    def local(frame, event, argument):
        if event == "line" and next(lines, None) is None:
            sys.settrace(None)
            raise KeyboardInterrupt
        return local

    before = sys.gettrace()
    sys.settrace(lambda frame, event, argument: local if Path(frame.f_code.co_filename).name in WRITERS else None)
    try:
        work()
    except KeyboardInterrupt:
        return True
    else:
        return False
    finally:
        sys.settrace(before)


@pytest.fixture(scope="module")
def equilibria(reference_packing):
    """Three of them, of which no more is asked than that they differ."""
    return [Equilibrium(replace(reference_packing(1.0), fx=k / 8), 0.0, 1e-12, 1) for k in range(3)]


@pytest.mark.parametrize("share", [1e-9, math.inf], ids=["saved at the end", "saved at once"])
@pytest.mark.long
def test_what_is_said_is_what_is_stored(tmp_path, monkeypatch, equilibria, share):
    path, scene, counts, number, interrupted = tmp_path / "run.h5", Scene.from_mapping(SCENE), set(), 0, True
    with Record(path, scene) as record:
        record.append(equilibria[0])
    begun = path.read_bytes()
    monkeypatch.setattr(runfile, "SHARE_OF_SAVING", share)
    while interrupted:
        path.write_bytes(begun)
        messages = []
        with Record(path, scene, saved=lambda says, path, to=messages: to.append(says)) as record:
            record.append(equilibria[1])
            interrupted = interrupted_at(number, lambda record=record: record.append(equilibria[2]))
        with RunFile(path) as run:
            assert f"holds {len(run)} equilibria, the last at F_x = {run.fx[-1]:g}; " in messages[-1], number
            counts.add(len(run))
        number += 1
    assert number > 60
    assert counts == {2, 3}


COSINE = {"amplitude": 1e-6, "omega": 3.0}
PULSE = {"signal": "pulse", "amplitude": 1e-6, "omega": 20.0}
FORCED = dict.fromkeys(["cosine", "cosine, compensated", "cosine, damped"], COSINE)
FORCED |= {"pulse, compensated": PULSE, "moving floor": PULSE | {"on": "floor"}}


def perturbed_scene(kind):
    perturb, friction = {"fx": 1e-3, "time": 0.3, **FORCED[kind]}, {"v0": 1e-9, "v_ss": 1e-6}
    more = {"damping": {"cn": 30.0, "ct": 20.0, "tau": 0.2}} if "damped" in kind else {}
    more |= {"precision": "compensated"} if "compensated" in kind else {}
    return Scene.from_mapping(SCENE | {"perturb": perturb, "friction": friction, "output": {"trajectory": True}} | more)


@pytest.mark.long
def test_a_film_of_an_undamped_run_is_stored_unasked(tmp_path):
    """Its states are those of the whole trajectory, at equal intervals up to the end; none where a scene wants none."""
    kept = {}
    for name, output in (("none", {"trajectory": False}), ("film", {}), ("all", {"trajectory": True})):
        wanted = Scene.from_mapping(SCENE | {"perturb": {"fx": 1e-3, "time": 1.5}, "output": output})
        *_, start = reach(wanted, wanted.perturb.fx)
        with Record(tmp_path / f"{name}.h5", wanted, task="perturb") as record:
            record.append(start)
            times = [sample.time for sample in record.undamped(wanted, start)]
        with RunFile(tmp_path / f"{name}.h5") as file:
            kept[name] = file.series("trajectory") if "trajectory" in file.names_of_series else None
    none, film, whole = kept.values()
    assert none is None
    np.testing.assert_array_equal(whole["time"], times)
    assert len(film["time"]) == 300
    assert film["time"][-1] == times[-1]
    # a state is the first sample at or after its time, and samples are a two-thousandth of the run apart
    np.testing.assert_allclose(film["time"], np.linspace(0, times[-1], 301)[1:], rtol=0, atol=6e-4 * times[-1])
    same = np.isin(whole["time"], film["time"])
    np.testing.assert_array_equal(whole["position"][same], film["position"])


LONG = "cosine", "cosine, compensated"


@pytest.mark.parametrize("kind", [pytest.param(each, marks=[pytest.mark.long] * (each in LONG)) for each in FORCED])
@pytest.mark.slow
def test_it_goes_on_to_the_bit(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(undamped, "SHORTEST_PART", 300)  # in place of 10,000 steps
    wanted = perturbed_scene(kind)
    *_, start = reach(wanted, wanted.perturb.fx)
    weakening, kept = weakening_of(wanted.friction, wanted.friction.v0), []
    whole = list(perturb(wanted, start, weakening=weakening, keep=kept.append))
    dt, steps = sample_steps(wanted.perturb, start.packing)
    assert len({sample.friction for sample in whole}) > 1
    rest = list(perturb(wanted, start, weakening=weakening, resume=kept[0]))
    assert rest == whole[np.searchsorted(steps, kept[0].step, side="right") :]

    with Record(tmp_path / "run.h5", wanted, task="perturb") as record:
        record.append(start)
        for sample in record.undamped(wanted, start, weakening=weakening):
            if sample.time > (kept[0].step + 100) * dt:
                break
    with RunFile(tmp_path / "run.h5") as file:
        assert file.checkpoint["step"] == kept[0].step
        assert not file.complete
    with Record(tmp_path / "run.h5", wanted, task="perturb") as record:
        assert list(record.undamped(wanted, record.last, weakening=weakening)) == whole
        record.finish()
    with RunFile(tmp_path / "run.h5") as file:
        assert (file.checkpoint, file.complete) == ({}, True)
        assert file.series("undamped")["msd"].tolist() == [sample.msd for sample in whole]
        assert file.series("trajectory")["time"].tolist() == [sample.time for sample in whole]


def test_a_ramp_goes_on_from_a_settled_packing_and_its_file_then_has_the_ramp(tmp_path):
    ramped, finer = (
        Scene.from_mapping(SCENE | {"ramp": {"step": step, "until": 2e-3}}, command="ramp") for step in (1e-3, 5e-4)
    )
    path, settled = tmp_path / "run.h5", Scene.from_mapping(SCENE, command="settle")
    with Record(path, settled) as record:
        record.append(settle(settled))
    with Record(path, ramped) as record:
        record.append(record.last)
    with Record(path, settled) as record:
        assert record.last is not None
    with pytest.raises(SceneError, match=r"ramp\.step is 0\.001 there and 0\.0005 here"):
        Record(path, finer)


SECTIONS = SCENE | {
    "damping": {"cn": 60.0},
    "ramp": {"step": 1e-3, "until": 2e-3},
    "perturb": {"fx": 1e-3, "time": 1.0, "signal": "signal"},
    "drive": {"spring": 3.0, "velocity": 1e-3, "until": 5.0, "signal": "signal", "at": 1.0},
}
NAMED = [("ramp", "packing.top", "named"), ("perturb", "perturb.signal", "signal"), ("drive", "drive.signal", "signal")]
NAMED += [(task, "packing.file", "packing.json") for task in ("ramp", "perturb", "drive")]


@pytest.mark.parametrize(("task", "key", "name"), NAMED)
def test_a_run_does_not_go_on_from_files_of_another_content(equilibria, tmp_path, monkeypatch, task, key, name):
    """The name is the same, and so are all keys."""
    monkeypatch.chdir(tmp_path)
    top = json.loads(REFERENCE.read_text())["top"]
    (tmp_path / "packing.json").write_bytes(REFERENCE.read_bytes())
    (tmp_path / "signal").write_text("0 0\n0.1 1e-9\n0.2 0\n")
    (tmp_path / "named").write_text(" ".join(str(1 + disk) for disk in top))
    given = {"file": "packing.json"} | ({"top": "ids:@named"} if name == "named" else {})
    scene = Scene.from_mapping(SECTIONS | {"packing": given}, tmp_path, command=task)
    with Record(tmp_path / "run.h5", scene, task=task) as run:
        run.append(equilibria[0])
    before = (tmp_path / name).read_text()
    (tmp_path / name).write_text(before + "\n")
    with pytest.raises(SceneError, match=rf"run of another scene \({key}, {name}, has another content now\): give"):
        Record(tmp_path / "run.h5", scene, task=task)
    (tmp_path / name).write_text(before)
    with Record(tmp_path / "run.h5", scene, task=task) as run:
        assert run.last.packing == equilibria[0].packing
