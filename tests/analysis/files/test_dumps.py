"""LAMMPS text dumps and JSON files, back to packings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from table_rows import rows_of

from faultgouge import load
from faultgouge.analysis import PackingFileError, read_dump
from faultgouge.analysis.files.formats.lammps_dump import dump_frames

DISK_COLUMNS = "id type x y radius mass d_theta fx fy tqz floor_slip floor_overlap"
CONTACT_COLUMNS = "id1 id2 f_n f_t slip"


def block(step, what, columns, rows):
    """One snapshot as LAMMPS writes it, %.17g."""
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF {what}\n{len(rows)}\nITEM: BOX BOUNDS pp ff pp\n"
    head += f"{0.0:-1.16e} {3.95:-1.16e}\n-2 9\n-0.5 0.5\nITEM: {what} {columns}\n"
    return head + "".join(" ".join(f"{value:.17g}" for value in row) + "\n" for row in rows)


def dump_text(packing, step=0):
    """Both snapshots of a packing: rows shuffled, partners swapped, and a pair that does not touch."""
    rng = np.random.default_rng(step)
    c, n = packing.contacts, len(packing)
    floor_slip = np.zeros(n)
    floor_slip[c.i[c.floor]] = c.slip[c.floor]
    known = packing.position, packing.radius, packing.mass, packing.angle, packing.net_force.reshape(3, n).T
    disks = np.column_stack([1 + np.arange(n), 1 + packing.top, *known, floor_slip, np.zeros(n)])
    pairs = [(i + 1, j + 1, 0, 0, s) for i, j, s in zip(c.i, c.j, c.slip, strict=True) if j >= 0]
    pairs = [(j, i, *rest) if rng.random() < 0.5 else (i, j, *rest) for i, j, *rest in pairs] + [(1, 3, 0, 0, 0)]
    shuffled = [pairs[k] for k in rng.permutation(len(pairs))]
    return block(step, "ATOMS", DISK_COLUMNS, disks[rng.permutation(n)]), block(
        step, "ENTRIES", CONTACT_COLUMNS, shuffled
    )


@pytest.fixture
def dump_path(tmp_path, cluster):
    """The cluster's dumps, with its sidecar file; returns the path of the disks' dump."""
    disks, contacts = dump_text(cluster)
    (tmp_path / "bed.disks").write_text(disks)
    (tmp_path / "bed.contacts").write_text(contacts)
    law = cluster.law
    numbers = {name: getattr(law, name) for name in ("kn", "kt", "mu", "exponent")}
    numbers |= {"fx": 0.5, "fy": 3, "inertia_factor": 0.5}
    (tmp_path / "bed.params").write_text("".join(f"{key} {value:.17g}\n" for key, value in numbers.items()))
    return tmp_path / "bed.disks"


def edit(path, old, new):
    path.write_text(path.read_text().replace(old, new))


def test_numbers_of_the_sidecar_over_which_the_law_of_the_caller_wins(dump_path, cluster):
    with dump_path.with_suffix(".params").open("a") as file:
        file.write("cn 1.5\nct 0.25\ntau 30\n")
    law = replace(cluster.law, cn=1.5, ct=0.25)
    for given, expected in (({}, law), ({"law": cluster.law}, cluster.law)):
        assert read_dump(dump_path, **given) == replace(cluster, law=expected, drag_time=30.0)


def test_frames_are_matched_by_step_and_read_to_the_bit(dump_path, cluster):
    states = [cluster, replace(cluster, angle=cluster.angle + 1), replace(cluster, angle=cluster.angle + 2)]
    snapshots = [dump_text(state, 10 * k) for k, state in enumerate(states)]
    dump_path.write_text("".join(disks for disks, _ in snapshots))
    dump_path.with_suffix(".contacts").write_text("".join(contacts for _, contacts in snapshots[::-1]))
    for frame, state in ((0, 0), (1, 1), (2, 2), (-1, 2), (-3, 0)):
        assert read_dump(dump_path, frame=frame) == states[state]
    assert [frame.step for frame in dump_frames(dump_path)] == [0, 10, 20]
    for frame in (3, -4):
        with pytest.raises(PackingFileError, match=f"no --frame {frame}"):
            read_dump(dump_path, frame=frame)


def test_names_as_lammps_has_them(dump_path, cluster):
    names = "c_ids[1] c_ids[2] c_contact[1] c_contact[2] c_contact[3]"
    edit(dump_path.with_suffix(".contacts"), CONTACT_COLUMNS, names)
    edit(dump_path, "floor_slip", "f_floor[3]")
    assert read_dump(dump_path) == cluster


@pytest.mark.parametrize(("suffix", "old", "new", "says"), rows_of("analysis/files/refused_dumps.txt"))
def test_spoiled_dumps(dump_path, suffix, old, new, says):
    edit(dump_path.with_suffix(suffix), *(text.replace("\\n", "\n") for text in (old, new)))
    with pytest.raises(PackingFileError, match=says):
        read_dump(dump_path)


@pytest.mark.parametrize("suffix", [".disks", ".contacts"])
def test_missing_and_cut_off_dumps(dump_path, suffix):
    path = dump_path.with_suffix(suffix)
    text = path.read_text()
    for size in (10, 60, 200, len(text) // 2):
        path.write_text(text[:size])
        with pytest.raises(PackingFileError, match=f"bed.{suffix[1:]}"):
            read_dump(dump_path)
    path.unlink()
    with pytest.raises(PackingFileError, match="cannot be read"):
        read_dump(dump_path)


def test_packing_from_json(tmp_path, reference, reference_packing):
    (tmp_path / "packing.json").write_text(json.dumps(reference))
    assert load(tmp_path / "packing.json", law=reference_packing(0.8).law, fy=3.0) == reference_packing(0.8)
