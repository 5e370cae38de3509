"""The packing of scenes/triggered.toml: seeds are tried until the rule of `studies/triggering/forecast.py` is met.

python -m research.triggering.make [FIRST] > research/triggering/triggered.jsonl
"""

import json
import sys
from itertools import count
from pathlib import Path

from faultgouge.pywrap import Scene
from faultgouge.studies.triggering.forecast import choose_seed

SCENE = Path(__file__).parents[2] / "scenes" / "triggered.toml"

if __name__ == "__main__":
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    for tried in choose_seed(Scene.from_toml(SCENE), count(first)):
        print(json.dumps(tried), flush=True)
