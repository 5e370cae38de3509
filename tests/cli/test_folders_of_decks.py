"""faultgouge import DECK.in leaves the deck's folder as `lmp -in` does, byte for byte, and takes LAMMPS's last state.

Of logs, the lines with times that the run took differ from run to run, and are left out.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pile_decks import DECK, ROUND

HEAD = DECK.format(**ROUND, word="contacts").rpartition("run 6000")[0]

STATE = """
thermo 50
dump state all custom 5 state.dump id x y z
dump_modify state sort id format float %.17g
"""

PARTS = {
    "@START\n": HEAD + STATE,
    "@HEAD\n": HEAD,
    "@LAW\n": HEAD[HEAD.index("variable kn") :],
    "@STATE\n": STATE,
    "@SECOND\n": HEAD.replace("boundary f f f", "boundary p p f").replace("0.45", "0.5"),
    "@OTHER\n": STATE.replace(" state ", " other "),
    "@END\n": "",
}
"""What stands for these lines in decks_of_users.txt: @END ends a file in the middle of a line."""

TEXT = (Path(__file__).parent / "decks_of_users.txt").read_text()
for part, fill in PARTS.items():
    TEXT = TEXT.replace(part, fill)
DECKS = {
    deck: dict(each.split("\n", 1) for each in f"deck.in\n{text}".split("---- "))
    for deck, text in (whole.split("\n", 1) for whole in TEXT.split("==== ")[1:])
}
"""Files by the names of decks."""

TIMES = re.compile(
    rb"^(Printed on |Loop time of|Performance:|[\d.]+% CPU use|Total wall time|.* CPU = "
    rb"|(Pair|Neigh|Comm|Output|Modify|Other) +\|)"
)

RUN_THEM = """
import json, math, os, sys
from pathlib import Path
import mpi4py
mpi4py.rc(initialize=False)  # each copy begins MPI itself
from mpi4py import MPI
from faultgouge.analysis import FaultgougeError
from faultgouge.pywrap.granular.run_deck import run_deck
for deck in sys.argv[1:]:  # each in a process where no LAMMPS was before
    child = os.fork()
    if child == 0:
        MPI.Init()
        try:
            says = run_deck(Path(deck), balance=math.inf).position.tolist()
        except FaultgougeError as error:
            says = str(error)
        print(json.dumps([deck, says]), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


def _files(folder):
    """All files of a folder; logs without times."""
    found = {}
    for path in (each for each in folder.rglob("*") if each.is_file()):
        fill = path.read_bytes()
        if path.suffix in (".log", ".lammps") or path.name == "info.txt":
            fill = [line for line in fill.splitlines() if not TIMES.match(line)]
        found[str(path.relative_to(folder))] = fill
    return found


@pytest.fixture(scope="module")
def folders(tmp_path_factory, lmp_of_the_environment):
    """For each deck, the folders that `lmp -in` and this program leave, and what this program has found."""
    base, (program, environment) = tmp_path_factory.mktemp("decks"), lmp_of_the_environment
    places = {name: base / name.replace(" ", "_") for name in DECKS}
    for name, files in DECKS.items():
        for file, fill in files.items():
            for path in (places[name] / who / file for who in ("lmp", "here")):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(fill)
        command = [program, "-in", "deck.in"]
        subprocess.run(command, cwd=places[name] / "lmp", env=environment, capture_output=True, check=False, timeout=60)
    decks = {str(place / "here" / "deck.in"): name for name, place in places.items()}
    fresh = {key: value for key, value in os.environ.items() if key != "LAMMPS_PLUGIN_PATH"}  # as in a user's shell
    command = [sys.executable, "-c", RUN_THEM, *decks]
    done = subprocess.run(command, env=fresh, capture_output=True, text=True, check=True, timeout=300)
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["')]
    return {decks[deck]: (places[decks[deck]] / "lmp", places[decks[deck]] / "here", says) for deck, says in found}


@pytest.mark.long
@pytest.mark.parametrize("name", DECKS)
def test_folder_and_last_state(folders, name):
    theirs, ours, state = folders[name]
    expected, found = _files(theirs), _files(ours)
    assert found.keys() == expected.keys()
    for file, fill in expected.items():
        assert found[file] == fill, file
    logs = [*expected.get("log.lammps", ()), *expected.get("deep/log.lammps", ())]
    assert isinstance(state, str) == any(line.startswith(b"ERROR") for line in logs), state
    dumps = [fill for file, fill in expected.items() if file.endswith("state.dump") and fill]
    if not isinstance(state, str) and dumps and name not in ("two systems", "particles go", "minimize"):
        assert np.array_equal(state, np.loadtxt(dumps[0].decode().splitlines()[-3:])[:, 1:])
