"""Input decks: as they stand, on two ranks; and the sentences with which LAMMPS refuses what cannot work."""

import pytest

from faultgouge.pywrap.lammps.decks import DECKS

SHORT = {"settle.in": (), "ramp.in": ("-var", "until", "2e-3"), "perturb.in": ("-var", "time", "0.5")}


@pytest.mark.ranks
@pytest.mark.parametrize("precision", ["double", pytest.param("compensated", marks=pytest.mark.long)])
@pytest.mark.parametrize("deck", SHORT)
@pytest.mark.slow
def test_deck_runs_alone_and_the_same_on_two_ranks(lmp, tmp_path, deck, precision):
    written = []
    for ranks in (1, 2):
        variables = ["-var", "decks", str(DECKS), "-var", "precision", precision]
        done = lmp(DECKS / deck, *variables, *SHORT[deck], ranks=ranks)
        assert done.returncode == 0, done.stdout[-2000:]
        assert "WARNING" not in done.stdout
        written.append({path.name: path.read_text() for path in sorted(tmp_path.glob("*.disks"))})
    assert written[0]
    assert written[0] == written[1]


@pytest.mark.ranks
@pytest.mark.slow
def test_ranks_share_the_disks_evenly(lmp):
    """The box is three times as high as the disks, and LAMMPS cuts its height first."""
    done = lmp(f"include {DECKS}/system.in\nrun 0", "-var", "decks", str(DECKS), ranks=2)
    assert "1 by 2 by 1 MPI processor grid" in done.stdout
    (share,) = (line.split() for line in done.stdout.splitlines() if line.startswith("Nlocal:"))
    assert float(share[3]) <= 1.1 * float(share[1])  # the most beside the mean


MODEL = """
units lj
dimension {dimension}
boundary p f p
atom_style sphere
{vel}
region box block 0 {width} -1 10 -0.5 0.5
create_box 1 box
create_atoms 1 single 1 0.499 0
create_atoms 1 single 2 0.499 0
set group all diameter 1.002
set group all mass 1.0
{pair}
{coeff}
{fix}
{run}
"""
GOOD = {
    "dimension": 2,
    "vel": "comm_modify vel yes",
    "width": 8,
    "pair": "pair_style mindlin/smooth 2e5 5e4 1.0",
    "coeff": "pair_coeff * *",
    "fix": "fix 1 all nve/disc 1.0",
    "run": "run 10",
}


def test_model_of_the_refusals_runs(lmp):
    assert lmp(MODEL.format(**GOOD)).returncode == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"pair": "pair_style mindlin/smooth 2e5 5e4"}, "takes three numbers, KN KT MU"),
        ({"pair": "pair_style mindlin/smooth 2e5 5e4 -1"}, "KN must be positive, KT and MU not negative"),
        ({"pair": "pair_style mindlin/smooth nan 5e4 1"}, "instead of 'nan'"),
        (
            {"pair": "pair_style mindlin/smooth 2e5 5e4 1 exact"},
            "knows the keywords exponent, history, damping, energy and compensated, but not exact",
        ),
        ({"pair": "pair_style mindlin/smooth 2e5 5e4 1 compensated"}, "moves disks without the low parts"),
        ({"fix": "fix 1 all nve/disc 1.0 compensated"}, "needs pair_style mindlin/smooth KN KT MU compensated"),
        (
            {"pair": "pair_style mindlin/smooth 2e5 0 0 compensated", "run": "minimize 0 1e-6 10 10"},
            "does not carry the low parts",
        ),
        ({"fix": "fix 1 all wall/mindlin/smooth 2e5 5e4 1.0 ylo 0.0 compensated"}, "must both have the keyword"),
        ({"coeff": "pair_coeff 1 1"}, "must start with * *"),
        ({"vel": ""}, "use comm_modify vel yes"),
        ({"dimension": 3}, "use dimension 2"),
        ({"width": 1.99}, "less than two diameters of the largest disk"),
        ({"run": "minimize 0 1e-6 10 10"}, "cannot be minimized"),
        ({"fix": "fix 1 all nve/disc"}, "takes one number, I0"),
        ({"fix": "fix 1 all nve/disc 0.0"}, "I0 must be a positive number"),
        ({"fix": "fix 1 all overdamped/disc 1.0"}, "takes two numbers, GAMMA and I0"),
        (
            {"fix": "fix 1 all nve/disc 1.0 turning no"},
            "rotation yes|no and compensated, but got turning",
        ),
        ({"fix": "fix 1 all nve/disc 1.0 rotation"}, "rotation takes yes or no"),
        ({"fix": "fix 1 all wall/mindlin/smooth 2e5 5e4 1.0 0.0"}, "takes KN KT MU ylo COORD"),
        ({"fix": "fix 1 all wall/mindlin/smooth 2e5 5e4 1.0 yhi 0.0"}, "knows a floor only"),
        ({"fix": "fix 1 all wall/mindlin/smooth 2e5 -5e4 1.0 ylo 0.0"}, "KT and MU not negative"),
        (
            {"run": "run 0\ngroup one id 1\ndelete_atoms group one\nrun 10"},
            "use delete_atoms with compress no",
        ),
        ({"fix": "fix 1 all nve/disc 1.0\ncreate_atoms 1 single 1 0.499 0\nset group all diameter 1.0"}, "same centre"),
        (
            {"fix": "fix 1 all nve/disc 1.0\ncreate_atoms 1 single 1.2 0.499 0\nset group all diameter 1.0"},
            "only 0.19999999999999996 apart, the centre of one inside of the other",
        ),
        (
            {"fix": "fix 1 all nve/disc 1.0\nfix 2 all wall/mindlin/smooth 2e5 5e4 1.0 ylo 0.6"},
            "has its centre at 0.499, below the floor",
        ),
        ({"run": "velocity all set 1e3 0 0\nrun 1000"}, "in one step, farther than its radius 0.501"),
    ],
    ids=lambda value: str(next(iter(value.values())))[:40] if isinstance(value, dict) else "",
)
def test_refused(said_against, change, says):
    if "width" in change:
        change = {**change, "fix": "fix 1 all nve/disc 1.0\nneighbor 0.05 bin"}
    assert says in said_against(MODEL.format(**{**GOOD, **change}))


def test_deleted_disks_leave_the_slips_of_the_others(lmp):
    done = lmp(MODEL.format(**{**GOOD, "run": "run 0\ngroup one id 1\ndelete_atoms group one compress no\nrun 10"}))
    assert done.returncode == 0, done.stdout[-1000:]
