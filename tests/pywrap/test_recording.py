"""What is said of run.h5 is what the stored file holds, at whatever line of the writing an interrupt comes."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from reference_layer import REFERENCE

from faultgouge.analysis import RunFile
from faultgouge.analysis.files import sealedfile
from faultgouge.pywrap import Equilibrium, Record, Scene

SCENE = {"packing": {"file": str(REFERENCE)}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
WRITERS = {"recording.py", "runfile.py", "sealedfile.py", "wholefile.py"}


def interrupted_at(number, work):
    """Whether work came to its n-th line in the files that write, where it was interrupted."""
    lines = iter(range(number))

    def local(frame, event, argument):
        if event == "line" and next(lines, None) is None:
            sys.settrace(None)
            raise KeyboardInterrupt
        return local

    def call(frame, event, argument):
        return local if Path(frame.f_code.co_filename).name in WRITERS else None

    before = sys.gettrace()
    sys.settrace(call)
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


@pytest.fixture(scope="module")
def equilibria(reference_packing):
    """Three of them, of which no more is asked than that they differ."""
    packing = reference_packing(1.0)
    return [Equilibrium(replace(packing, fx=k / 8), 0.0, 1e-12, 1) for k in range(3)]


def opened(path, said):
    return Record(path, Scene.from_mapping(SCENE), saved=said.append)


@pytest.fixture(scope="module")
def begun(tmp_path_factory, equilibria):
    """The bytes of a file with the first equilibrium."""
    path = tmp_path_factory.mktemp("begun") / "run.h5"
    with opened(path, []) as record:
        record.append(equilibria[0])
    return path.read_bytes()


@pytest.mark.parametrize("share", [1e-9, math.inf], ids=["saved at the end", "saved at once"])
@pytest.mark.long
def test_what_is_said_is_what_is_stored(tmp_path, monkeypatch, begun, equilibria, share):
    monkeypatch.setattr(sealedfile, "SHARE_OF_SAVING", share)
    path, counts, number, interrupted = tmp_path / "run.h5", set(), 0, True
    while interrupted:
        path.write_bytes(begun)
        said = []
        with opened(path, said) as record:
            record.append(equilibria[1])
            interrupted = interrupted_at(number, lambda: record.append(equilibria[2]))
        with RunFile(path) as run:
            assert f"holds {len(run)} equilibria, the last at F_x = {run.fx[-1]:g}; " in said[-1], number
            counts.add(len(run))
        number += 1
    assert number > 60
    assert counts == {2, 3}
