"""What is refused: one sentence, an exit code, and nothing is written."""

import pytest
from reference_layer import LAYER, REFERENCE, toml

SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 4e-3}, "perturb": {"fx": 1.5e-3, "time": 0.5}})


@pytest.mark.parametrize(
    ("command", "change", "code", "says"),
    [
        ("perturb", ("kn = 2e5", "kn = -1.0"), 2, "law.kn = -1.0 is refused: give a number above 0"),
        ("perturb", (str(REFERENCE), "no.json"), 2, "no.json"),
        ("perturb", ("fy = 3.0", "fy = 300.0"), 2, "the packing is not in balance, a disk feels"),
        ("perturb", ("time = 0.5", "time = 0.5\ntime_step = 0.1"), 2, "over the limit 2/omega_max"),
        ("perturb", ("time = 0.5", "time = 1e-9"), 2, "shorter than one step"),
        ("onset", ("", ""), 1, "No pair of eigenvalues is complex up to F_x = 0.004"),
        ("onset", ("[ramp]", "[damping]\ncn = 1.0\n[ramp]"), 1, "No motion grows up to F_x = 0.004"),
        ("onset", ("[ramp]", "[damping]\n[ramp]"), 2, "damping"),
        ("onset --modes 0:10", ("[ramp]", "[damping]\nct = 1.0\n[ramp]"), 2, "--modes goes without [damping]"),
    ],
)
@pytest.mark.slow
def test_a_scene_that_cannot_be_run(refusal, tmp_path, command, change, code, says):
    (tmp_path / "scene.toml").write_text(SCENE.replace(*change))
    assert says in refusal(*command.split(), "scene.toml", code=code)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ("init", 2, "scene.toml exists"),
        ("ramp no.toml", 2, "no.toml: the scene cannot be read"),
        ("ramp scene.toml -o ramp.h5", 2, "holds a run of another scene (load.fy is 3.0 there and 3.00001 here)"),
        ("rampp scene.toml", 2, "rampp"),
        ("spectrum no.h5", 2, "no.h5 does not exist"),
        ("spectrum scene.toml", 2, "scene.toml is not a readable HDF5 file"),
        ("spectrum no.disks", 2, "no.disks cannot be read"),
        ("onset scene.toml --modes 600", 2, "as in --modes 0:600"),
        ("onset scene.toml --modes 5:5", 2, "as in --modes 0:600"),
        ("onset scene.toml --modes 900:910", 2, "are no part of"),
        ("draw ramp.h5 -o p.bmp", 2, "a .png, a .svg or a .pdf"),
        ("draw ramp.h5 --mode all", 2, "--mode all: give pair, or the number of a mode, from 0"),
        ("draw ramp.h5 --mode 9999", 2, "modes, counted from 0"),
        ("draw ramp.h5 --mode pair --frame 0", 2, "no two of them are about to meet"),
        ("draw none.h5", 2, "does not exist"),
        ("movie ramp.h5 -o film.avi", 2, "a .gif or an .mp4"),
        ("movie perturb.h5 --span 5 6", 2, "its times go from 0 to"),
        ("export ramp.h5 -o packing.pdb", 2, "exports are .vtp, .xyz, .data, .gsd"),
        ("export ramp.h5 -o packing.data --mode pair", 2, "has no room for modes"),
        ("export ramp.h5 --frame 9", 2, "there is no frame 9"),
        ("export ramp.h5 -o nowhere/packing.vtp", 1, "cannot be written"),
        ("export ramp.h5 -o film.pvd", 2, "add --frames all"),
        ("export ramp.h5 -o film.vtp --frames all", 2, "several frames go into .xyz, .gsd, .pvd"),
        ("export ramp.h5 -o film.xyz --frames 3", 2, "give all, START:STOP or START:STOP:STEP"),
        ("export ramp.h5 -o film.xyz --frames 5:9", 2, "has 5 frames, and none of them is meant"),
        ("export ramp.h5 -o film.xyz --frames all --mode pair", 2, "without --frame and --mode"),
    ],
)
@pytest.mark.slow
def test_a_command_that_cannot_be_run(refusal, tmp_path, beyond, command, code, says):
    (tmp_path / "scene.toml").write_text((beyond / "scene.toml").read_text().replace("fy = 3.0", "fy = 3.00001"))
    for name in ("ramp.h5", "perturb.h5"):
        (tmp_path / name).symlink_to(beyond / name)
    assert says in refusal(*command.split(), code=code)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["perturb.h5", "ramp.h5", "scene.toml"]
