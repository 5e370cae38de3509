"""A run.h5 that holds a Configuration gives it back to the bit."""

import pytest
from test_linearised_contacts import make

from faultgouge.analysis.files.configuration_file import holds_configuration, read_configuration, write_configuration


@pytest.mark.parametrize("d", [2, 3])
def test_to_the_bit(d, tmp_path):
    snapshot = make(d)
    write_configuration(tmp_path / "run.h5", snapshot, {"deck": "run 0"})
    assert holds_configuration(tmp_path / "run.h5")
    assert not holds_configuration(tmp_path / "none.h5")
    found = read_configuration(tmp_path / "run.h5")
    assert found == snapshot
    assert found != make(d, slides=False)
    assert not found.position.flags.writeable
