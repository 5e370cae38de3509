"""Ways of running LAMMPS that the styles do not serve: one sentence before the run."""

import pytest

from faultgouge.pywrap.lammps.decks import DECKS

FRICTIONLESS = "variable mu index 0.0\n"
MODEL = f"variable decks index {DECKS}\ninclude {DECKS}/system.in\ntimestep 1e-3\n"
ALONE = """
units lj
dimension 2
boundary p p p
atom_style sphere
region box block 0 4 0 4 -0.1 0.1
create_box 1 box
create_atoms 1 single 1 1 0
set group all diameter 1.0 mass 1.0
pair_style zero 1.0 nocoeff
pair_coeff * *
run_style respa 2 2
"""
# a growing radius needs ghosts whose radii are sent in every step
GROWING = MODEL.replace("system.in", "growing.in")
DUMP = "fix still all displace/disc\nrun 0\nwrite_dump all custom seen.dump id x y\nunfix still\n"
RERUN = f"{MODEL}{DUMP}rerun seen.dump dump x y\n"
REFUSED = {
    "pair style": (f"{MODEL}run_style respa 2 2\nrun 0\n", "pair mindlin/smooth does not work under run_style respa"),
    "nve/disc": (f"{ALONE}fix move all nve/disc 1.0\nrun 10\n", "fix nve/disc does not work under run_style respa"),
    "overdamped/disc": (
        f"{ALONE}fix move all overdamped/disc 1.0 1.0\nrun 10\n",
        "fix overdamped/disc does not work under run_style respa",
    ),
    "addforce/signal": (
        f"{ALONE}fix push all addforce/signal cosine 1.0 1.0\nrun 10\n",
        "fix addforce/signal does not work under run_style respa",
    ),
    "a signal in a minimization": (
        f"{FRICTIONLESS}{MODEL}fix push top addforce/signal cosine 1.0 1.0\nminimize 0 1e-3 10 10\n",
        "a minimizer has no time",
    ),
    "weakening in a minimization": (
        f"{FRICTIONLESS}{MODEL}comm_modify vel yes\nfix weaken top weaken/friction 1 0 0 1 0 1\n"
        "minimize 0 1e-3 10 10\n",
        "cannot be minimized, since its forces depend on the path",
    ),
    "rerun": (RERUN, "pair mindlin/smooth with friction cannot serve rerun"),
    "radii that change": (
        f"{GROWING}variable d equal 1.0+step*dt\nfix grow all adapt 1 atom diameter v_d\n"
        "fix move all nve/disc 1.0\nrun 1\n",
        "fix grow of style adapt changes radii within a run",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.slow
def test_it_is_refused_in_a_sentence(lmp, tmp_path, case):
    script, says = REFUSED[case]
    text = (DECKS / "system.in").read_text().replace("atom_style      sphere", "atom_style sphere 1")
    (tmp_path / "growing.in").write_text(text)
    done = lmp(script.replace(f"{DECKS}/growing.in", "growing.in"), fails=True)
    assert says in " ".join((done.stdout + done.stderr).split())


@pytest.mark.slow
def test_without_friction_a_rerun_is_served(lmp):
    lmp(FRICTIONLESS + RERUN)
