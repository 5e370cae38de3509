"""Contacts with forces of other codes: a live packing of LAMMPS through tables of six digits, and bad tables."""

import numpy as np
import pytest
from periodic_box import at_rest
from scipy.linalg import eigvals
from scipy.optimize import brentq
from table_rows import rows_of

from faultgouge.analysis import (
    FaultgougeError,
    damping_matrix,
    elastic_moduli,
    mass_weighted,
    stability,
    stiffness_matrix,
)
from faultgouge.analysis.files.contact_tables import material_of, read_contacts, verdict_within_digits
from faultgouge.analysis.files.formats import read_particles, write_packing
from faultgouge.pywrap import from_lammps

LAW = "kn=1000,kt=800,friction=0.5,rescales=1,gamma=100,gamma_t=100"


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """Spheres at rest in LAMMPS, and their dumps with LAMMPS's own six digits."""
    folder = tmp_path_factory.mktemp("tables")
    lmp = at_rest(3, folder / "log.lammps", count=16)
    lmp.commands_string(f"""
compute ids all property/local patom1 patom2
compute forces all pair/local dist force p1 p2 p3
dump spheres all custom 1 {folder}/spheres.dump id x y z radius mass
dump contacts all local 1 {folder}/local.dump index c_ids[*] c_forces[*]
run 0
""")
    found = from_lammps(lmp)
    lmp.close()
    return folder, found


def write_tables(folder, packing):
    """The same contacts with six digits, as the other codes write them."""
    c, zero = packing.contacts, np.zeros((len(packing.contacts), 4))
    ids = np.column_stack([packing.ids[c.i], packing.ids[c.j]])
    fn, ft, size = c.normal_force[:, None], c.tangential_force, np.linalg.norm(c.tangential_force, axis=1)[:, None]
    head = f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ENTRIES\n{len(c)}\nITEM: BOX BOUNDS pp pp pp\n" + 3 * "0 1\n"
    head += f"ITEM: ENTRIES {' '.join(f'c_f[{k}]' for k in range(1, 13))}"
    tables = {
        # each contact from both sides, and here with the tangential force of the second
        "mercury.fstat": (
            "# 0 16\n# info\n# info",
            [zero[:, :1], ids - 1, zero[:, :3], c.overlap[:, None], zero[:, :1], fn, size, c.normal, -ft / size],
        ),
        # forces on the second
        "yade.txt": ("id1 id2 fnx fny fnz fsx fsy fsz", [ids - 1, -fn * c.normal, -ft]),
        # pos id force, from either side
        "liggghts.dump": (head, [zero, zero[:, :2], ids[:, ::-1], zero[:, :1], -(fn * c.normal + ft)]),
        "table.csv": ("id1,id2,fn,ftx,fty,ftz", [ids, fn, ft]),
    }
    for name, (names, columns) in tables.items():
        mark = "," if name == "table.csv" else " "
        np.savetxt(folder / name, np.hstack(columns), "%.6g", mark, header=names, comments="")


LOCAL = ["index", "id1", "id2", "dist", "fn", "ftx", "fty", "ftz"]
LIGGGHTS = ["x1", "y1", "z1", "x2", "y2", "z2", "id1", "id2", "image", "fx", "fy", "fz"]
BY_INDEX = ("mercury.fstat", "yade.txt")


TABLES = {"local.dump": LOCAL, "table.csv": None, "liggghts.dump": LIGGGHTS, "mercury.fstat": None, "yade.txt": None}


@pytest.mark.parametrize(("name", "columns"), TABLES.items())
def test_the_verdict_of_a_table_is_the_live_one(live, name, columns):
    folder, packing = live
    write_tables(folder, packing)
    spheres = read_particles(folder / "spheres.dump")
    if name in BY_INDEX:  # codes that count from 0
        object.__setattr__(spheres, "id", spheres.id - 1)
    found = read_contacts(spheres, folder / name, material_of(LAW), columns)
    assert len(found.contacts) == len(packing.contacts)
    assert ("with the other sign" in found.remarks[0]) == (name == "mercury.fstat")
    if name in ("local.dump", "mercury.fstat"):  # of six digits and of both signs
        verdict, says = verdict_within_digits(found)
        told = stability(packing)
        assert verdict.stable == told.stable is True
        assert verdict.growth_rate == pytest.approx(told.growth_rate, rel=1e-4)
        assert says.startswith("six digits tell: 5 tables that round to this one")
    assert elastic_moduli(found).shear == pytest.approx(elastic_moduli(packing).shear, rel=1e-4)


def test_the_command_takes_tables(live, faultgouge_here, tmp_path):
    folder, _ = live
    done = faultgouge_here(
        "import", str(folder / "spheres.dump"), "--contacts", str(folder / "local.dump"), "--columns", ",".join(LOCAL),
        "--material", LAW, "-o", str(tmp_path / "p.h5"),
    )  # fmt: skip
    assert "stable: every motion decays" in done.stdout
    assert "six digits tell" in done.stdout
    again = faultgouge_here("timestep", str(tmp_path / "p.h5"))
    assert "largest stable time step" in again.stdout


def test_digits_that_do_not_tell_are_told(live):
    """Dashpots are weakened until the fastest growth is zero: whether a motion grows is then a matter of digits."""
    folder, packing = live
    write_tables(folder, packing)

    def of(gamma):
        law = material_of(LAW.replace("gamma=100,gamma_t=100", f"gamma={gamma:.17g},gamma_t=0"))
        return read_contacts(read_particles(folder / "spheres.dump"), folder / "table.csv", law)

    def growth(gamma):
        found = of(gamma)
        a, g = (mass_weighted(each, found).toarray() for each in (stiffness_matrix(found), damping_matrix(found)))
        s = eigvals(np.block([[np.zeros_like(a), np.eye(len(a))], [-a, -g]]))
        return s.real[np.abs(s) > 1e-3 * np.abs(s).max()].max()

    assert growth(1e-9) > 0 > growth(1e3)
    root = brentq(lambda power: growth(10.0**power), -9, 3, xtol=1e-10)
    _, says = verdict_within_digits(of(10.0**root))
    assert says.startswith("six digits do not tell: of 5 tables that round to this one the verdict is ")


SPHERES = "id,x,y,z,radius,mass\n1,0,0,0,0.5,1\n2,0.999,0,0,0.5,1\n3,5,0,0,0.5,1\n"
CONTACTS = "id1,id2,fn,ftx,fty,ftz\n1,2,1.0,0,0.1,0\n"


@pytest.mark.parametrize(("table", "old", "new", "word"), rows_of("exchange/refused_contacts.txt"))
def test_a_bad_table_is_refused_in_one_sentence(tmp_path, table, old, new, word):
    texts = {"spheres": SPHERES, "contacts": CONTACTS, "material": "young=1"}
    texts[table] = texts[table].replace(old.replace("\\n", "\n"), new.replace("\\n", "\n").strip("'"))
    (tmp_path / "s.csv").write_text(texts["spheres"])
    (tmp_path / "c.csv").write_text(texts["contacts"])
    with pytest.raises(FaultgougeError) as raised:
        read_contacts(read_particles(tmp_path / "s.csv"), tmp_path / "c.csv", material_of(texts["material"]))
    assert word in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("suffix", [".data", ".xyz"])
def test_spheres_come_from_any_format_with_radii(live, tmp_path, suffix):
    """With their box, and the numbers of the packing to the bit."""
    _, packing = live
    write_packing(tmp_path / f"spheres{suffix}", packing)
    found, order = read_particles(tmp_path / f"spheres{suffix}"), np.argsort(packing.ids)
    np.testing.assert_array_equal(found.position, packing.position[order])
    np.testing.assert_array_equal(found.radius, packing.radius[order])
    np.testing.assert_allclose(found.mass, packing.mass[order], rtol=1e-15)
    np.testing.assert_allclose(found.box, packing.box, rtol=1e-15)
