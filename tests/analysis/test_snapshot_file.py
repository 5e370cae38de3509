"""A run.h5 that holds a Snapshot gives it back to the bit, or is refused."""

import numpy as np
import pytest
from test_linearised_contacts import make

from faultgouge.analysis import PackingFileError
from faultgouge.analysis.files.snapshot_file import holds_snapshot, read_snapshot, write_snapshot


@pytest.mark.parametrize("d", [2, 3])
def test_to_the_bit(d, tmp_path):
    snapshot = make(d)
    write_snapshot(tmp_path / "run.h5", snapshot, {"deck": "run 0"})
    assert holds_snapshot(tmp_path / "run.h5")
    found = read_snapshot(tmp_path / "run.h5")
    assert found == snapshot
    assert found != make(d, slides=False)
    assert not found.position.flags.writeable


def test_without_contacts(tmp_path):
    bare = make(3).loaded(np.inf)
    write_snapshot(tmp_path / "run.h5", bare)
    assert read_snapshot(tmp_path / "run.h5") == bare


def test_damage_is_refused(tmp_path):
    path = tmp_path / "run.h5"
    write_snapshot(path, make(3))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(PackingFileError, match="damaged"):
        read_snapshot(path)
    with pytest.raises(PackingFileError, match="does not exist"):
        read_snapshot(tmp_path / "none.h5")
    assert not holds_snapshot(tmp_path / "none.h5")
