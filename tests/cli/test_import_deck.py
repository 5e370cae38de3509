"""faultgouge import DECK.in, and what takes the file that it leaves."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from mpi4py import MPI
from pile_decks import DECK, FLAT, ROUND

from faultgouge.analysis.files.configuration_file import read_configuration
from faultgouge.pywrap.lammps.instance import lammps_instance


@pytest.fixture
def taken(faultgouge_here, tmp_path):
    """Imports a deck; what the command says, and the configuration that it has stored, none if it is refused."""

    def take(text: str, *words: str, name: str = "pile", code: int = 0):
        (tmp_path / f"{name}.in").write_text(text)
        done = faultgouge_here("import", f"{name}.in", "-o", f"{name}.h5", *words, code=code)
        return (done.stderr, None) if code else (done.stdout, read_configuration(tmp_path / f"{name}.h5"))

    return take


PILE = {word: DECK.format(**ROUND, word=word) for word in ("contacts", "")}
DISKS = DECK.format(**FLAT, word="contacts")
SPRINGS = "hertz/history ${kn} NULL 10 NULL 0.9 1"


def of_granular(law: str) -> str:
    """The pile of spheres with a law of `granular`."""
    deck = PILE[""].replace(f"pair_style gran/{SPRINGS}", "pair_style granular")
    return deck.replace(f"gran {SPRINGS}", f"gran granular {law}").replace("* *", f"* * {law}")


@pytest.mark.parametrize("shape", [FLAT, ROUND], ids=["disks", "spheres"])
def test_deck(faultgouge_here, taken, tmp_path, shape):
    from faultgouge.analysis import eigenvalues

    (tmp_path / "own").mkdir()
    pile = "own/pile.h5"
    said, configuration = taken(DECK.format(**shape, word="contacts"), name="own/pile")
    assert f"3 {'disks' if shape is FLAT else 'spheres'}, " in said
    assert configuration.residual < 1e-6
    found = json.loads(faultgouge_here("spectrum", pile, "--json").stdout)["eigenvalues"]
    assert [complex(*each) for each in found] == pytest.approx(list(eigenvalues(configuration)), abs=1e-8)
    assert "as LAMMPS left them" in faultgouge_here("spectrum", pile).stdout

    faultgouge_here("export", pile, "--mode", "1", "-o", "pile.vtp")
    piece = ElementTree.parse(tmp_path / "pile.vtp").find(".//Piece")
    assert (piece.get("NumberOfVerts"), piece.get("NumberOfLines")) == ("3", str(len(configuration.contacts)))
    names = {each.get("Name"): each.get("NumberOfComponents") for each in piece.find("PointData")}
    assert names["mode_1"] == names["mode_1_rotation"] == names["net_force"] == "3"
    faultgouge_here("export", pile, "-o", "pile.data")
    lammps = lammps_instance(MPI.COMM_SELF, None)
    lammps.commands_list(["atom_style sphere", f"read_data {tmp_path}/pile.data"])
    order, place, mass = (np.array(lammps.numpy.extract_atom(name)[:3]) for name in ("id", "x", "rmass"))
    lammps.close()
    assert np.array_equal(place[np.argsort(order), : configuration.dimension], configuration.position)
    np.testing.assert_allclose(mass.ravel()[np.argsort(order)], configuration.mass, rtol=1e-15)
    refusals = ["spectrum --rise | has no upper layer", "movie | no run of ours"]
    drawn = ["--mode", "1"] if shape is FLAT else []
    assert ("mode 1 of 9" if drawn else "3 contacts (3 with walls)") in faultgouge_here("draw", pile, *drawn).stdout
    if shape is ROUND:
        refusals += ["movie --mode 0 | a film shows", "export --mode 99 -o pile.vtp | 15 modes, counted from 0"]
    for command, says in (each.split(" | ") for each in refusals):
        assert says in faultgouge_here(*command.split(), pile, code=2).stderr


SIDE = "fix side all wall/gran hertz/history ${{kn}} NULL 10 NULL 0.9 1 xplane -0.94 NULL {word}\nfix move"


@pytest.mark.long
@pytest.mark.parametrize("walls", [1, 2])
def test_walls_that_hand_out_no_contacts(taken, walls):
    """The word `contacts` changes no motion, and the contacts are found without it, in a corner of two walls, too."""
    deck, shape = (DECK, ROUND) if walls == 1 else (DECK.replace("fix move", SIDE), ROUND | {"down": "-0.3 0 -1"})
    told, without = (taken(deck.format(**shape, word=word), name=f"pile{word}")[1] for word in ("contacts", ""))
    one, other = told.contacts, without.contacts
    assert without.operators == "laws"
    assert np.array_equal(one.i, other.i)
    assert np.array_equal(np.unique(one.i[one.wall], return_counts=True)[1], [1, 1, 1] if walls == 1 else [2, 1, 1])
    for name in ("normal", "overlap", "normal_force", "tangential_force", "tangential_stiffness"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-12 * one.normal_stiffness.max())


def pour(g=1, rise: object = 0.0) -> str:
    """Five spheres that fall into a bin, whose floor may rise."""
    law = f"hertz 2e3 10 tangential mindlin 1.5e3 1 0.5 rolling sds 100 {g} 0.2"
    return (Path(__file__).parent / "pour.in").read_text().format(law=law, rise=rise)


def test_what_has_been_poured_comes_to_rest(taken):
    """A deck that ends while its particles move, with fix pour, which lets no time step be changed; and with a region
    that may move, but stays."""
    said, _ = taken(pour(), code=1)
    assert re.search("The packing moves: the residual of particle .* bring it to rest by .* a command --relax", said)
    _, found = taken(pour(), "--relax")
    assert (len(found), found.operators, found.proof < 1e-5) == (5, "differences", True)
    assert found.residual < 1e-7 * found.mass.mean()


def test_a_run_that_fix_halt_has_ended(taken):
    """LAMMPS skips all further runs; the particles come to rest all the same."""
    halted = "variable now equal step\nfix stop all halt 10 v_now > 1500 error soft message no\nrun 6000"
    deck = PILE[""].replace("run 6000", halted)
    assert "The packing moves" in taken(deck, code=1)[0]
    assert taken(deck, "--relax")[1].residual < 1e-8


@pytest.mark.long
@pytest.mark.ranks
def test_a_deck_on_two_ranks(faultgouge, taken, tmp_path):
    """A look needs a copy of the process. What several ranks have run is taken by a process of one, a step on."""
    _, one = taken(PILE[""])
    faultgouge("import", "pile.in", "-o", "two.h5", ranks=2)
    two = read_configuration(tmp_path / "two.h5")
    assert two.position == pytest.approx(one.position, abs=1e-9)
    assert two.contacts.tangential_force == pytest.approx(one.contacts.tangential_force, abs=1e-7)
    assert "one step after the end of the deck on 2 ranks" in two.remarks[-1]


def test_a_line_at_which_lammps_stops(faultgouge_here, taken, tmp_path):
    """The state of the runs before it is kept."""
    deck = PILE["contacts"].replace("run 6000", "run 1500\ncompute what all no/such/style")
    said, _ = taken(deck, name="stops", code=1)
    assert re.search("LAMMPS stopped: Unrecognized compute style .* is kept in stops.restart, and the deck stops", said)
    assert "3 spheres, " in faultgouge_here("import", "stops.restart", "--relax", "-o", "stops.h5").stdout
    said, _ = taken(deck.replace("run 1500", "velocity all set 1e3 0 0\nrun 1500"), name="lost", code=1)
    assert re.search("Lost atoms: original 3 current 0.*The state is not kept: LAMMPS stopped: Lost atoms", said)
    assert not (tmp_path / "lost.restart").exists()  # nothing is left to keep


@pytest.mark.long
def test_time_step_with_which_nothing_rests(taken):
    """Rolling dashpots stronger than the time step allows: spheres vibrate for ever, as their friction bounds it."""
    said, _ = taken(pour(g=500).replace("pour 5", "pour 8"), "--relax", code=1)
    found = re.search(r"its time step 0.002 is longer than the largest stable one, (\S+), of its contacts", said)
    assert 1e-5 < float(found[1]) < 0.002


COHESIVE = "jkr 1e3 0.05 0.3 10 tangential mindlin 800 1 0.5 rolling sds 100 1 0.2"


def test_any_model_in_a_region(faultgouge_here, taken):
    """K and C by differences of forces, and the command says so, with the time step."""
    bowl = f"region bowl sphere 0 0 3 3 side in\nfix bowl all wall/gran/region granular {COHESIVE} region bowl"
    deck = re.sub("(?m)^fix floor .*$", bowl, of_granular(COHESIVE)).replace("run 6000", "run 30000")
    said, found = taken(deck)
    assert re.search("(?s)3 spheres, .*K and C by differences of forces to .*largest stable time step ", said)
    assert (found.operators, found.operator_error < 1e-5) == ("differences", True)
    assert "eigenvalues" in json.loads(faultgouge_here("spectrum", "pile.h5", "--json").stdout)
    faultgouge_here("export", "pile.h5", "--mode", "1", "-o", "pile.vtp")


def test_time_step_beside_rayleighs(taken):
    """Young's modulus 1e3, Poisson's ratio 0.25: G = 400, and Rayleigh's step is pi R sqrt(rho/G) / 0.9174."""
    said, _ = taken(of_granular("hertz/material 1e3 10 0.25 tangential mindlin NULL 1 0.9"))
    assert re.search(r"^(stable|unstable): ", said, re.MULTILINE)
    step, share, usual = map(float, re.search(r"step (\S+), (\S+) of Rayleigh's formula \((\S+)\)", said).groups())
    assert usual == pytest.approx(np.pi * 0.5 / np.sqrt(400) / (0.1631 * 0.25 + 0.8766), rel=1e-3)
    assert share == pytest.approx(step / usual, rel=1e-2)


@pytest.mark.parametrize("name", ["short", "ü 5% of $x & *"])
def test_a_state_that_moves_is_kept(faultgouge_here, taken, tmp_path, name):
    """Where the run was too short, the restart goes on as the deck itself does, tangential histories and all. No file
    of the user's is touched: not a restart of the same name, nor one of a row that the deck writes."""
    deck = PILE["contacts"]
    (tmp_path / f"{name}.in").write_text(deck.replace("run 6000", "restart 1000 short.restart.*\nrun 1500"))
    mine = {"short.restart": b"mine", "short.restart.9000": b"mine, too", "short.2.restart.in": b"a deck"}
    for file, fill in mine.items():
        (tmp_path / file).write_bytes(fill)
    said = faultgouge_here("import", f"{name}.in", "-o", f"{name}.h5", code=1).stderr
    assert re.search(r"The packing moves: the residual of particle [123] at \(", said)
    kept = tmp_path / re.search(r"The state, one step on, is kept in (\S+), and the deck (\S+) beside it", said)[1]
    assert re.fullmatch(r"[A-Za-z0-9_.+-]+", kept.name)
    assert {file: (tmp_path / file).read_bytes() for file in mine} == mine
    assert (tmp_path / "short.restart.1000").is_file()
    assert not (tmp_path / f"{name}.h5").exists()
    again = faultgouge_here("import", f"{name}.in", "-o", f"{name}.h5", code=1).stderr
    assert f"is kept in {kept.name.replace('.restart', '.1.restart').replace('1.1', '3')}, and" in again
    with kept.with_name(f"{kept.name}.in").open("a") as beside:
        beside.write("run 4499\n")
    faultgouge_here("import", kept.name, "-o", "on.h5")
    on, (_, whole) = read_configuration(tmp_path / "on.h5"), taken(deck, name="whole")
    # the first step after a restart has the dashpots of another half step, a force of 1e-4 here
    assert on.position == pytest.approx(whole.position, abs=1e-6)
    tangential = whole.contacts.tangential_force
    assert np.abs(on.contacts.tangential_force - tangential).max() < 1e-3 * np.abs(tangential).max()


def test_bare_files_of_lammps(refusal, taken):
    """A restart or data file without contacts and laws: a deck around it has these."""
    ends = "run 10\nwrite_restart pile.restart\nwrite_data pile.data\n"
    taken(PILE[""].replace("run 6000", ends), "--balance", "1e9")
    assert "write a deck with read_restart" in refusal("import", "pile.restart")
    assert "write a deck with units lj" in refusal("import", "pile.data")


def test_packing_in_which_nothing_touches(faultgouge_here, taken):
    far = DISKS.replace("0.5 0 units", "0.7 0 units").replace("0.45", "0.8").replace("1.3", "2.5")
    assert "3 disks, 0 contacts" in taken(far.replace("run 6000", "run 0"))[0]
    for command in ("draw --mode pair -o far.png", "export --mode 0 -o far.vtp"):
        assert "the packing has 0 modes" in faultgouge_here(*command.split(), "pile.h5", code=None).stderr
    assert "no frame 3" in faultgouge_here("draw", "pile.h5", "--frame", "3", code=2).stderr


ROW = (Path(__file__).parent / "row.in").read_text()
LIGGGHTS = "units si\natom_style sphere\nregion b block 0 1 0 1 0 1\ncreate_box 1 b\n"
AFTER = "compute pairs all pair/local force\nwrite_restart pile.restart\n"
RISES, FOLLOWS = pour(rise="1e-6*elapsed"), "LAMMPS's forces change with the time, though nothing moves: a load, a wall"
REFUSED = [
    ("pile.in --kn 3", DISKS, 2, "only -o, --relax and --balance go with it"),
    ("pile.in --balance nan", DISKS, 2, "greater than or equal to 0"),
    ("a.csv --balance 1", "", 2, "--balance is for a LAMMPS deck"),
    ("in.wrong", "units nothing\npair_style granular\n", 1, "LAMMPS stopped: "),
    ("pile.lammps", DISKS, 2, "LAMMPS deck"),
    ("lig.in", "atom_style granular\n", 1, "this is a deck of LIGGGHTS, whose"),
    ("lig.in", "units si\nhard_particles yes\n", 1, "this is a deck of LIGGGHTS, whose"),
    ("lig.in", f"{LIGGGHTS}fix m1 all property/global youngsModulus peratomtype 5.e6\n", 1, "of LIGGGHTS, whose"),
    ("cleared.in", f"{DISKS}clear\n", 1, "no pair_style after `clear`, which takes all away"),
    ("mute.in", f"echo none\n{DISKS}", 1, "no pair_style: leave `echo none` and `echo log` out"),
    ("mute.in", f"echo log\n{DISKS}", 1, "no pair_style: leave `echo none` and `echo log` out"),
    ("empty.in", re.sub("(?m)^(create_atoms|set) .*\n", "", PILE[""]), 1, "has no particles. No state is kept"),
    # a part of an intersection: its place is another one in each run
    ("rises.in", RISES, 1, FOLLOWS),
    ("rises.in --relax", RISES, 1, FOLLOWS),
    # LAMMPS forgets histories there, since the compute has asked for another list of neighbours
    ("lost.in", f"{ROW}{AFTER}", 1, "write_restart, rerun, reset_atoms, and delete_atoms without `compress no`, lose"),
]


@pytest.mark.parametrize(("words", "deck", "code", "says"), REFUSED)
def test_what_is_refused_is_said_with_its_cause(faultgouge_here, tmp_path, words, deck, code, says):
    file, *more = words.split()
    (tmp_path / file).write_text(deck)
    said = faultgouge_here("import", file, *more, code=code).stderr
    assert says in said
    assert "from_lammps" not in said  # a user of the command has no script in Python
    assert not (tmp_path / "packing.h5").exists()
    assert ("is kept in packing.restart" in said) == (tmp_path / "packing.restart").exists()


def test_contacts_at_the_bound(faultgouge_here, taken):
    """Friction a little below what the packing uses: LAMMPS cuts these contacts to the bound."""
    c = taken(ROW, name="rough")[1].contacts
    mu = (np.linalg.norm(c.tangential_force, axis=1) / c.normal_force)[~c.wall].max() * (1 - 1e-7)
    said, found = taken(f"{ROW}pair_style gran/hertz/history 1e3 NULL 10 NULL {mu:.17g} 1\nrun 0\n", name="slid")
    count = int(found.contacts.at_bound.sum())
    assert 0 < count == int(re.search(r"(\d+) at Coulomb's bound, sticking in K", said)[1])
    verdict, *_ = faultgouge_here("spectrum", "slid.h5").stdout.partition("5 disks")
    assert f"{count} of {len(c)} contacts are at Coulomb's bound: each slides on ahead" in verdict


def test_a_law_that_is_another_one_than_its_line_says(taken):
    """K has LAMMPS's: the wall of hooke/history has another tangential stiffness in LAMMPS of 22 Jul 2025."""
    said, found = taken(DISKS.replace("wall/gran hertz/history ${kn}", "wall/gran hooke/history 1e3"))
    assert found.proof < 1e-5
    assert found.remarks == ("drag of fix drag (viscous) is left out",)
    assert found.remarks[0] in said
