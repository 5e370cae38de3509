"""packing.json, the format of packings that are made by hand."""

from pathlib import Path

import numpy as np

from ...analysis import MindlinLaw, read_packing
from .disks import Disks


def read_json(path: Path) -> Disks:
    """Disks of a packing.json."""
    packing = read_packing(path, MindlinLaw(kn=1.0, kt=0.0, mu=0.0))  # the file says nothing about forces
    return Disks(
        str(path),
        packing.position,
        packing.radius,
        np.arange(1, len(packing) + 1),
        top=packing.top if packing.top.any() else None,
        box_length=packing.box_length,
    )
