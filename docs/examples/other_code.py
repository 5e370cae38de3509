"""A table of disks from another code: columns x, y, radius. The disks come to rest under this law and load."""

from pathlib import Path

import numpy as np

from faultgouge import load, spectrum
from faultgouge.analysis import MindlinLaw
from faultgouge.pywrap import Engine, bring_to_rest, equilibrate

# a table as another code may write it: three rows of disks on a floor, every second row shifted by a radius
rows = [(k + 0.5 * (row % 2), 0.5 + row * 0.866) for row in range(3) for k in range(6)]
radius = 0.5 + 0.004 * np.cos(np.arange(18) ** 2)
table = "x,y,radius\n" + "\n".join(f"{x},{y},{r}" for (x, y), r in zip(rows, radius, strict=True))
Path("disks.csv").write_text(table)

law = MindlinLaw(kn=2e5, kt=2e5 * 2 / 7, mu=1.0)
loose = load("disks.csv", law=law, fy=3.0, top=6, width=6.02)
rest, words = bring_to_rest(loose)
print(words)
with Engine(rest.packing) as engine:
    pushed = equilibrate(engine, rest, fx=0.05)
found = spectrum(pushed.packing)
print(f"at F_x = {pushed.fx:g}: {len(pushed.packing.contacts)} contacts, lowest eigenvalue", end=" ")
print(f"{found.eigenvalues.real.min():.3f}, residual {pushed.residual:.1e}")
