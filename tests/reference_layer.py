"""The reference packing as a scene of the command line, and where the command lies."""

import sys
from pathlib import Path

BIN = Path(sys.executable).parent

REFERENCE = Path(__file__).parent / "reference" / "packing7.json"

LAYER = f"""
[packing]
file = "{REFERENCE}"
[law]
kn = 2e5
[load]
fy = 3.0
"""
"""Under its load; sections follow."""
