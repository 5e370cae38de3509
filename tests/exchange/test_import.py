"""Packings of other codes: what is read, brought to rest, and refused in one sentence; docs/howto_own_packing.md."""

import gzip
import json
import re
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from reference_layer import BIN
from table_rows import rows_of

from faultgouge import load
from faultgouge.analysis import BadInputError, MindlinLaw, PackingFileError, RunFile, nearest_image, spectrum, stability
from faultgouge.analysis.files.atomic_write import SEAL
from faultgouge.analysis.files.formats import read_disks, upper_layer, write_packing
from faultgouge.analysis.files.formats.disks import mass_of_density
from faultgouge.pywrap import Scene, SceneError, settle
from faultgouge.pywrap.lammps import restart_file

LAW = ("--kn", "2e5", "--fy", "3")


def table(packing, names, mark=" ", **more):
    """A line a disk: what the packing, or another column, has by these names."""
    x, y = packing.position.T
    known = {"id": np.arange(1, len(x) + 1), "x": x, "y": y, "z": 0 * x, "radius": packing.radius}
    known |= {"top": packing.top, "type": 1 + packing.top} | more
    rows = zip(*(known[name].tolist() for name in names), strict=True)
    return "".join(mark.join(f"{number:.17g}" for number in row) + "\n" for row in rows)


def csv(packing, names):
    return f"{names}\n{table(packing, names.split(','), ',')}"


def dump(packing, step=0, count=None):
    n = len(packing) if count is None else count
    rows = table(packing, ("id", "type", "x", "y", "z", "radius")).splitlines(keepends=True)
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS pp ff pp\n"
    head += f"0 {packing.box_length}\n-1 60\n-0.5 0.5\nITEM: ATOMS id type x y z radius\n"
    return head + "".join(rows[:n])


def read_to_the_bit(path, text, packing):
    """What is read of a text, which has places and radii of a packing."""
    path.write_text(text)
    disks = read_disks(path)
    np.testing.assert_array_equal(disks.position, packing.position)
    np.testing.assert_array_equal(disks.radius, packing.radius)
    return disks


def yade(packing, columns):
    """As yade.export.textExt writes it, but for its six digits."""
    own = {"r": packing.radius, "matId": 1 + packing.top, "id": np.arange(len(packing)), "attrs": packing.mass}
    return f"#format {columns}\n# mass\n{table(packing, columns.split('_'), **own)}"


def mercury(packing, dimensions=2, times=(0.0, 0.5)):
    """As MercuryDPM's DPMBase::outputXBallsData writes it; at earlier times the particles are higher."""
    text, width = "", packing.box_length
    for time in times:
        bounds = f"0 0 {width} 9" if dimensions == 2 else f"0 0 -1 {width} 9 1"
        text += f"{len(packing)} {time} {bounds}\n"
        higher = packing.position[:, 1] + (times[-1] - time)
        names = "x y z z radius z z top" if dimensions == 2 else "x y z z z z radius z z z z z z top"
        text += table(packing, names.split(), y=higher)
    return text


@pytest.mark.parametrize("columns", ["x_y_z_r", "id_x_y_z_r_matId", "x_y_z_r_attrs"])
def test_yade_text(tmp_path, sheared, columns):
    disks = read_to_the_bit(tmp_path / "packing.txt", yade(sheared, columns), sheared)
    assert disks.box_length is None
    if "matId" in columns:
        np.testing.assert_array_equal(upper_layer(disks, "type:2"), sheared.top)


@pytest.mark.parametrize(("dimensions", "name"), [(2, "run.data"), (3, "run.data.0012")])
def test_mercury_data(tmp_path, sheared, dimensions, name):
    disks = read_to_the_bit(tmp_path / name, mercury(sheared, dimensions), sheared)
    assert disks.box_length == sheared.box_length
    np.testing.assert_array_equal(upper_layer(disks, "type:1"), sheared.top)
    np.testing.assert_array_equal(read_disks(tmp_path / name, 0).position, sheared.position + np.array([0, 0.5]))


def test_what_is_compressed_is_what_it_was(tmp_path, sheared):
    """LAMMPS itself writes a dump whose name ends in .gz, and text of any other code may be compressed, too."""
    for name, text in (("dump.500.gz", dump(sheared)), ("a.csv.gz", csv(sheared, "x,y,radius"))):
        (tmp_path / name).write_bytes(gzip.compress(text.encode()))
        np.testing.assert_array_equal(read_disks(tmp_path / name).position, sheared.position)
    (tmp_path / "cut.dump.gz").write_bytes(gzip.compress(dump(sheared).encode())[:-100])
    with pytest.raises(BadInputError, match=r"cut\.dump\.gz"):
        read_disks(tmp_path / "cut.dump.gz")


@pytest.mark.parametrize(("mass", "top"), [(2.5, [2]), ([2.0, 3.0, 4.0], [False, False, True])])
def test_packing_json_has_masses_and_the_layer_by_number_or_by_truth(tmp_path, mass, top):
    disks = {"x": [0.5, 1.6, 2.7], "y": [0.5, 0.5, 0.5], "radius": [0.5] * 3, "top": top, "mass": mass}
    (tmp_path / "packing.json").write_text(json.dumps(disks))
    found = read_disks(tmp_path / "packing.json")
    assert (found.top.tolist(), found.mass.tolist()) == ([False, False, True], np.broadcast_to(mass, 3).tolist())


def test_the_layer_may_be_said_in_six_ways(tmp_path, sheared):
    (tmp_path / "a.dump").write_text(dump(sheared))
    (tmp_path / "ids").write_text("1 2\n5-7\n")
    disks, (x, y) = read_disks(tmp_path / "a.dump"), sheared.position.T
    held = np.isin(np.arange(len(y)), [*sheared.contacts.i, *sheared.contacts.j])
    tenth = np.sort(y[held])[-10]
    assert not held[y >= tenth].all()  # a disk among them touches nothing
    some = np.isin(np.arange(len(y)), [0, 1, 4, 5, 6])
    ways = {"10": held & (y >= tenth), "type:2": sheared.top, "y>8 and x<=5": (y > 8) & (x <= 5)}
    ways |= dict.fromkeys(("ids:1,2,5-7", f"ids:@{tmp_path / 'ids'}"), some)
    for says, expected in ways.items():
        np.testing.assert_array_equal(upper_layer(disks, says), expected)
    for says in ("y>1000", "0"):
        with pytest.raises(BadInputError, match="holds no disk"):
            upper_layer(disks, says)
    for says in ("type:7", "ids:1-1000", "ids:a", "group:upper", "y>>3", "z>3", "101", "y>e", "ids:@nowhere"):
        with pytest.raises(BadInputError, match="--top"):
            upper_layer(disks, says)


def test_lammps_reads_its_data_and_a_restart_has_all_of_it_and_groups(lmp, tmp_path, sheared):
    write_packing(tmp_path / "packing.data", sheared)
    done = lmp(
        "units lj\ndimension 2\nboundary p f p\natom_style sphere\nread_data packing.data\ngroup odd id 1:99:2\n"
        "group gone id 1\ngroup upper type 2\ngroup gone delete\npair_style gran/hertz/history 2e5 NULL 50 NULL 0.5 1\n"
        "pair_coeff * *\ncomm_modify vel yes\nrun 0\nwrite_restart packing.restart\n"
    )
    assert done.returncode == 0, done.stdout
    with pytest.raises(PackingFileError, match="LAMMPS itself reads it"):
        read_disks(tmp_path / "packing.restart")
    disks = restart_file.read_disks(tmp_path / "packing.restart")
    for says, layer in (("group:upper", sheared.top), ("type:2", sheared.top), ("group:odd", disks.id % 2 == 1)):
        np.testing.assert_array_equal(upper_layer(disks, says), layer)
    moved = nearest_image(disks.position - sheared.position, sheared.box_length)  # LAMMPS takes images into the box
    np.testing.assert_allclose(moved, 0, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(disks.radius, sheared.radius)
    np.testing.assert_allclose(disks.mass, sheared.mass, rtol=2.3e-16)  # a last bit: density times volume is rounded
    assert disks.box_length == sheared.box_length


@pytest.mark.ranks
@pytest.mark.parametrize("slips", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.slow
def test_disks_out_of_balance_come_to_rest(tmp_path, faultgouge, faultgouge_here, reference_packing, sheared, slips):
    """Without friction, or with slips, and then with friction; on any number of ranks."""
    packing, digits = (sheared, 6) if slips else (reference_packing(1.0), 3)
    # with 3 digits, a hundredth of an overlap, forces of the order of the load; with 6, forces of 1e-2
    rounded, c = replace(packing, position=np.round(packing.position, digits)), packing.contacts
    (tmp_path / "rough.csv").write_text(csv(rounded, "x,y,radius,top"))
    table_of_slips = np.column_stack([c.i + 1, c.j + 1, c.slip])
    np.savetxt(tmp_path / "slips.csv", table_of_slips, "%.17g", ",", header="id1,id2,slip", comments="")
    words = ["import", "rough.csv", "--width", packing.box_length, *LAW, "--fx", packing.fx]
    words += ["--contacts", "slips.csv"] * slips
    refused = faultgouge_here(*words, "-o", "one.h5", code=2)
    assert re.search("not in balance under .*fy = 3.*--relax", refused.stderr)
    assert not (tmp_path / "one.h5").exists()
    for name, run in (("one.h5", faultgouge_here), ("two.h5", partial(faultgouge, ranks=2))):
        assert "brought to rest" in run(*words, "--relax", "-o", name).stdout
    rest = load(tmp_path / "one.h5")
    assert rest == load(tmp_path / "two.h5")
    assert (rest.fx, rest.residual < 1e-9) == (packing.fx, True)
    if slips:  # friction keeps the slips to within what the disks have moved
        np.testing.assert_allclose(rest.contacts.slip, c.slip, rtol=0, atol=1e-6)
        return
    assert not rest.contacts.slip.any()
    # the packing is the one that was rounded: the reference is an equilibrium of the same law
    moved = nearest_image(rest.position - packing.position, packing.box_length)
    held = np.setdiff1d(np.arange(len(packing)), np.union1d(rest.rattlers, packing.rattlers))
    assert np.abs(moved[held]).max() < 0.01


def test_a_scene_takes_the_same_files(tmp_path, reference, reference_packing):
    packing = reference_packing(1.0)
    (tmp_path / "packing.dump").write_text(dump(packing))
    (tmp_path / "packing.json").write_text(json.dumps(reference))
    rest = {"law": {"kn": 2e5}, "load": {"fy": 3.0}}

    def settled(**section):
        return settle(Scene.from_mapping({"packing": section, **rest}, tmp_path)).packing

    expected = settled(file="packing.json")
    assert settled(file="packing.dump", top="type:2") == expected
    with pytest.raises(SceneError, match="does not say which disks are the upper layer"):
        settled(file="packing.dump")


BAD = [
    ("a.dump", lambda p: dump(p).replace("radius", "size"), "no column radius or diameter"),
    ("a.dump", lambda p: dump(p).replace(" 0 ", " 9 ", 1), "three dimensions (z goes from 0 to 9)"),
    ("a.dump", lambda p: dump(p)[:-200], "not a complete LAMMPS text dump"),
    ("a.dump", lambda p: re.sub(r"(?m)^(0 11.9|-1 60|-0.5 0.5)$", r"\1 1", dump(p)), "tilted box"),
    ("a.data", lambda p: mercury(p, 3, (0.0,)).replace(" 0 0 0 ", " 1 0 0 ", 1), "three dim"),
]
"""Files, and what is said of them; more in refused_files.txt."""


@pytest.mark.parametrize(("name", "text", "says"), [*BAD, *rows_of("exchange/refused_files.txt")])
def test_bad_input_is_refused_in_one_sentence(tmp_path, sheared, name, text, says):
    text = text(sheared) if callable(text) else text if isinstance(text, str) else json.dumps(text)
    (tmp_path / name).write_text(text.strip("'").replace("\\n", "\n"))
    with pytest.raises(BadInputError) as refused:
        load(tmp_path / name, law=MindlinLaw(2e5, 5e4, 1.0), fy=3.0, top=1)
    assert says in str(refused.value)
    assert name in str(refused.value)


@pytest.mark.slow
def test_options_that_do_not_fit(tmp_path, refusal, sheared):
    (tmp_path / "a.dump").write_text(dump(sheared))
    (tmp_path / "scene.toml").write_text("[law]\nkn = 2e5\n[load]\nfy = 3.0\n")
    (tmp_path / "apart.csv").write_text("x,y,radius\n1,3,0.5\n3,3,0.5\n")
    (tmp_path / "run.h5").write_bytes(SEAL)
    for words, says in rows_of("exchange/refused_options.txt"):
        assert says in refusal("import", *words.replace("LAYER", "--top type:2 --kn 2e5 --fy 3").split())


HOWTO = Path(__file__).parents[2] / "docs" / "howto_own_packing.md"


@pytest.mark.long
def test_from_a_pour_to_the_film_of_the_mode(tmp_path):
    """The commands of the page, as they stand there."""
    text = HOWTO.read_text()
    deck, scene = re.findall(r"```\n(.*?)```", text, re.DOTALL)
    (tmp_path / "pour.in").write_text(deck)
    (tmp_path / "own.toml").write_text(scene)
    commands = re.findall(r"^    ((?:lmp|faultgouge) .*)$", text, re.MULTILINE)
    assert len(commands) == 6
    said = {}
    for command in commands:
        program, *words = command.split()
        done = subprocess.run([BIN / program, *words], cwd=tmp_path, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        said[" ".join([program, *words[:1]])] = done.stdout + done.stderr
    assert "brought to rest" in said["faultgouge import"]
    with RunFile(tmp_path / "run.h5") as run:
        assert 0 < float(re.search(r"F_x\^c = ([\d.]+)", said["faultgouge onset"])[1]) < run.fx[-1]
    assert "complex pair" in said["faultgouge draw"]
    assert (tmp_path / "mode.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "mode.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".xyz", ".data", ".gsd"])
def test_that_slips_are_not_known_goes_wherever_the_packing_goes(tmp_path, suffix):
    """From the table of a disk that rests on another, which stands on the floor; without tangential forces."""
    low, high = np.cumsum([0.5, 1.0]) - np.cumsum([(each / 2e5) ** (2 / 3) for each in (6.0, 3.0)])
    heap, given = tmp_path / "heap.csv", {"law": MindlinLaw(2e5, 5e4, 1.0), "fy": 3.0}
    heap.write_text(f"x,y,radius,top\n1.0,{low:.17g},0.5,1\n1.0,{high:.17g},0.5,1\n")
    packing, file = load(heap, **given), heap if suffix == ".csv" else tmp_path / f"stored{suffix}"
    if suffix == ".h5":
        with RunFile.create(file, packing) as run:
            run.append(packing)
            run.complete = True
    elif suffix != ".csv":
        write_packing(file, packing)
    again = load(file, **given)
    for found in (again, again.configuration, again.moved(again.position, again.angle, again.contacts)):
        assert not found.slips_known
    assert stability(again).stable is spectrum(again).is_stable is None
    for says in (str(stability(again)), repr(spectrum(again))):
        assert "tangential forces were not given" in says
    scene = Scene.from_mapping({"packing": {"file": str(file)}, "law": {"kn": 2e5}, "load": {"fy": 3.0}})
    # a scene begins without slips where its file says nothing of them
    assert settle(scene).packing.slips_known is (suffix == ".csv")
    assert stability(load(heap, law=replace(given["law"], kt=0.0, mu=0.0), fy=3.0)).stable is not None
    assert stability(replace(again, slips_known=True)).reasons == ()


def test_masses_are_those_before_lammps_wrote_densities_of_sixteen_digits():
    from faultgouge.lammps_inputs import __file__ as decks

    shipped = read_disks(Path(decks).parent / "packing100.data")
    assert set(shipped.mass.tolist()) == {1.0}
    radius = np.random.default_rng(0).uniform(0.3, 0.8, 500)
    volume = 4.0 * np.pi / 3.0 * radius * radius * radius
    for mass in (1.0, 0.37, 2.5e-6):
        written = np.array([float(f"{each:.16g}") for each in mass / volume])
        assert np.array_equal(mass_of_density(written, radius), np.full(500, mass))
    odd = np.random.default_rng(1).uniform(1.0, 2.0, 500)
    assert np.array_equal(mass_of_density(odd, radius), odd * volume)
