"""Tables of laboratories: decimal commas, heads, comments; slips and upper layers that fit no contact."""

from dataclasses import replace

import pytest
from table_rows import rows_of

from faultgouge.analysis import BadInputError, MindlinLaw, PackingFileError
from faultgouge.analysis.files.formats import packing_of, read_disks, upper_layer
from faultgouge.analysis.files.formats.tables import read_slips

LAW = MindlinLaw(2e5, 5e4, 0.5)


@pytest.fixture
def read(tmp_path):
    def write_and_read(text, name="lab.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return read_disks(tmp_path / name)

    return write_and_read


@pytest.mark.parametrize("text", [text for (text,) in rows_of("exchange/tables_of_laboratories.txt")])
@pytest.mark.parametrize("name", ["lab.csv", "lab.txt"])
def test_tables_as_others_write_them(read, text, name):
    for escape, letter in (("\\n", "\n"), ("\\t", "\t"), ("\\ufeff", "\ufeff")):
        text = text.replace(escape, letter)
    disks = read(text, name)
    assert (disks.position.tolist(), disks.radius.tolist()) == ([[1.25, 0.5], [2.24, 0.5]], [0.5, 0.5])


ROW = "id,x,y,radius\n1,1,0.5,0.5\n2,1.999,0.5,0.5\n3,3.2,0.5,0.5\n4,1.5,1.365,0.5\n"


def with_slips(read, tmp_path, rows, head="id1;id2;slip"):
    disks = read(ROW)
    (tmp_path / "contacts.csv").write_text(f"{head}\n{rows}", encoding="utf-8")
    return replace(disks, slips=read_slips(tmp_path / "contacts.csv"))


def test_slips_are_those_of_the_table(read, tmp_path):
    disks = with_slips(read, tmp_path, "1;2;5e-4\n4;1;-0,25e-3\n3;4;0\n")
    contacts = packing_of(disks, LAW, upper_layer(disks, 1), fy=1.0).contacts
    found = dict(zip(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True), contacts.slip.tolist(), strict=True))
    assert found[0, 1] == 0.5e-3
    assert found[0, 3] == -0.25e-3


@pytest.mark.parametrize(("table", "says"), rows_of("exchange/refused_slips.txt"))
def test_slips_that_fit_no_contact_are_refused(read, tmp_path, table, says):
    head, rows = table.replace("\\n", "\n").split("\n", 1)
    with pytest.raises(PackingFileError, match=says):
        packing_of(disks := with_slips(read, tmp_path, rows, head), LAW, upper_layer(disks, 1), fy=1.0)


XYZ = """4
Lattice="9 0 0 0 9 0 0 0 1" Properties=species:S:1:pos:R:3:radius:R:1 mu=high
Fe 1 0.5 0 0.5
Fe 2 0.5 0 0.5
Al 1.5 1.36 0 0.5
2 1.5 5 0 0.5
"""


def test_types_have_names(read):
    disks = read(XYZ, "a.xyz")
    assert upper_layer(disks, "type:Al").tolist() == [False, False, True, False]
    assert upper_layer(disks, "type:2").tolist() == [False, False, False, True]
    assert upper_layer(disks, 2).tolist() == [True, False, True, False]  # the highest that touch something
    with pytest.raises(BadInputError, match=r"has no type Cu \(its types: Fe, Al, 2\)"):
        upper_layer(disks, "type:Cu")


def test_gsd_of_another_program_has_names_of_types(tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd", reason="gsd comes with the extra export")
    frame, given = hoomd.Frame(), {"typeid": [1, 0], "types": ["Al", "Fe"], "diameter": [1, 1]}
    vars(frame.particles).update(given | {"N": 2, "position": [[0, 0.5, 0], [1, 0.5, 0]]})
    frame.configuration.box = [9, 9, 0, 0, 0, 0]
    with hoomd.open(str(tmp_path / "a.gsd"), "w") as file:
        file.append(frame)
    disks = read_disks(tmp_path / "a.gsd")
    assert upper_layer(disks, "type:Al").tolist() == [False, True]
    assert upper_layer(disks, "type:2").tolist() == [True, False]  # the second type, which has no such name
