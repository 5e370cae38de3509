"""A run.h5 that holds a Configuration gives it back to the bit, or is refused."""

import h5py
import numpy as np
import pytest
from test_linearised_contacts import make

from faultgouge.analysis import PackingFileError, RunFile
from faultgouge.analysis.files.checksummed_file import new_file, write
from faultgouge.analysis.files.configuration_file import holds_configuration, read_configuration, write_configuration


@pytest.mark.parametrize("d", [2, 3])
def test_to_the_bit(d, tmp_path):
    snapshot = make(d)
    write_configuration(tmp_path / "run.h5", snapshot, {"deck": "run 0"})
    assert holds_configuration(tmp_path / "run.h5")
    found = read_configuration(tmp_path / "run.h5")
    assert found == snapshot
    assert found != make(d, slides=False)
    assert not found.position.flags.writeable


def test_without_contacts(tmp_path):
    bare = make(3).loaded(np.inf)
    write_configuration(tmp_path / "run.h5", bare)
    assert read_configuration(tmp_path / "run.h5") == bare


def test_damage_is_refused(tmp_path):
    path = tmp_path / "run.h5"
    write_configuration(path, make(3))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    for reads in (read_configuration, holds_configuration):
        with pytest.raises(PackingFileError, match=r"damaged: its .* bytes do not have the checksum"):
            reads(path)
    with pytest.raises(PackingFileError, match="does not exist"):
        read_configuration(tmp_path / "none.h5")
    assert not holds_configuration(tmp_path / "none.h5")


def test_damage_anywhere_is_refused_by_the_checksum(tmp_path):
    """HDF5 is not asked before: it has errors of its own for what it meets."""
    path, rng = tmp_path / "run.h5", np.random.default_rng(0)
    write_configuration(path, make(3))
    content = path.read_bytes()
    for _ in range(200):
        changed = bytearray(content)
        for at in rng.integers(512, len(content), 12):
            changed[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        with pytest.raises(PackingFileError, match="damaged"):
            holds_configuration(path)


def test_a_snapshot_is_no_run(tmp_path):
    write_configuration(tmp_path / "run.h5", make(2))
    with pytest.raises(PackingFileError, match=r"as LAMMPS left it, and no run .* spectrum, draw"):
        RunFile(tmp_path / "run.h5")


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
        (huge, "has the shape"),
    ],
)
def test_what_the_checksum_does_not_cover_is_refused(tmp_path, change, says):
    path = tmp_path / "run.h5"
    write_configuration(path, make(2))
    with h5py.File(path) as stored, new_file() as file:
        for name in stored:
            stored.copy(name, file)
        change(file)
        write(path, file)
    with pytest.raises(PackingFileError, match=says):
        read_configuration(path)
