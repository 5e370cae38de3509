"""Measured forces, in RigidLibrary's two files: counts that are known, a chance, and no rate."""

import numpy as np
import pytest

from faultgouge.analysis import Material, PackingFileError
from faultgouge.analysis.files.measured_forces import measured_forces

SPRINGS = Material(kn=1e3, kt=800.0, exponent=1.0, friction=0.3)
TRIANGLE = [[1, 0.0, 0.0, 0.5, 1], [2, 1.0, 0.0, 0.5, 1], [3, 0.5, np.sqrt(0.75), 0.5, 1]]


def written(folder, disks, rows):
    np.savetxt(folder / "particles.txt", disks, delimiter=",")
    np.savetxt(folder / "contacts.txt", rows, delimiter=",")
    return folder / "particles.txt", folder / "contacts.txt"


@pytest.mark.long
@pytest.mark.parametrize(
    ("pairs", "share", "at_bound", "floppy"),
    [
        ([(1, 2)], 0.1, 0, 1),  # two disks roll on each other
        ([(1, 2)], 0.4, 1, 2),  # and spin, if the contact slides
        ([(1, 2), (2, 3), (1, 3)], 0.1, 0, 0),  # three disks in a ring cannot roll
        ([(1, 2), (2, 3), (1, 3)], 0.4, 3, 3),
    ],
)
def test_motions_without_stiffness(tmp_path, pairs, share, at_bound, floppy):
    """Of each contact both rows, whose f_n differ by a tenth; an earlier step does not count."""
    rows = [
        [2, *ends, share * f, f] for one, other in pairs for ends, f in (((one, other), 0.95), ((other, one), 1.05))
    ]
    found, says = measured_forces(*written(tmp_path, TRIANGLE, [[1, 1, 2, 0.0, 1.0], *rows]), SPRINGS)
    assert len(found.contacts) == len(pairs)
    assert found.contacts.normal_force == pytest.approx(1.0)
    assert f"{at_bound} at Coulomb's bound" in says[0]
    assert says[1].startswith(f"{floppy} motions without stiffness")
    assert "of 10 draws of the forces within an error of f_n of 0.1," in says[2]
    assert not found.slips_known
    assert not any("exp(" in each for each in says)


@pytest.mark.parametrize(
    ("row", "says"),
    [([1, 1, 9, 0, 1], "names disk 9"), ([1, 1, 2, 1], "rows of 4 numbers"), ([1, 1, 2, 0, np.nan], "all finite")],
)
def test_bad_tables(tmp_path, row, says):
    with pytest.raises(PackingFileError, match=says):
        measured_forces(*written(tmp_path, TRIANGLE, [row]), SPRINGS)


def test_the_command_tells_chances(tmp_path, faultgouge_here):
    written(tmp_path, TRIANGLE, [[1, 1, 2, 0.1, 1.0], [1, 2, 3, 0.1, 1.0], [1, 1, 3, 0.1, 1.0]])
    words = ["import", "particles.txt", "--contacts", "contacts.txt", "--material", "kn=1e3,exponent=1,friction=0.3"]
    said = faultgouge_here(*words, "-o", "lab.h5").stdout
    assert "its error, and a chance, are not known" in said
    assert "no growth rate is given" in said
    assert "not known" in faultgouge_here("stability", "lab.h5").stdout
