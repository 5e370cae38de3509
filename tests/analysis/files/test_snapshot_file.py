"""A run.h5 that holds a Configuration gives it back to the bit, or is refused."""

import h5py
import numpy as np
import pytest
from test_linearised_contacts import make

from faultgouge.analysis import PackingFileError
from faultgouge.analysis.files.checksummed_file import new_file, write
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


def elsewhere(file):
    del file["snapshot/radius"]
    file.create_dataset("snapshot/radius", (7,), "f8", external=[("raw", 0, 56)])


def replace_by_link(file):
    del file["snapshot/radius"]
    file["snapshot/radius"] = h5py.ExternalLink("other.h5", "/radius")


def huge(file):
    del file["snapshot/radius"]
    file.create_dataset("snapshot/radius", (10**13,), "f8", chunks=(1000,))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (elsewhere, "numbers in another file"),
        (replace_by_link, "link to another file"),
        (huge, "more than its 0 bytes hold"),
    ],
)
def test_what_the_checksum_does_not_cover_is_refused(tmp_path, change, says):
    path = tmp_path / "run.h5"
    write_snapshot(path, make(2))
    with h5py.File(path) as stored, new_file() as file:
        for name in stored:
            stored.copy(name, file)
        change(file)
        write(path, file)
    with pytest.raises(PackingFileError, match=says):
        read_snapshot(path)
