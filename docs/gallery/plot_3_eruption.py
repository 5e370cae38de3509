"""
An eruption
===========

At a large load several pairs are complex. No force pushes the packing: only the rounding of its coordinates starts the
motion.
"""

import numpy as np
from matplotlib.figure import Figure

from faultgouge.analysis import spectrum
from faultgouge.figures import draw_series
from faultgouge.figures.film import RunMotion, film_of_run
from faultgouge.pywrap import Scene, perturb, reach

scene = Scene.from_mapping(
    {
        "packing": {"seed": 4, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 2e-2, "until": 0.5},
        "perturb": {"fx": 0.5, "time": 40.0},
    }
)
*_, start = reach(scene, 0.5)
moments = []
samples = list(perturb(scene, start, watch=lambda time, motion: moments.append((time, motion.position.copy()))))

# %%
# The mean square displacement grows by fifteen decades, at the rate that the spectrum predicts.

time, msd = (np.array([getattr(each, name) for each in samples]) for name in ("time", "msd"))
print(f"D grows as exp({spectrum(start.packing).growth_rate():.2f} t)")
growth = draw_series(time, msd)

# %%
# Three frames of the film that ``faultgouge movie`` makes: displacements times a power of ten.

run = RunMotion.of(start.packing, np.array([each[0] for each in moments]), np.array([each[1] for each in moments]))
film = film_of_run(run, frames=3)
frames = Figure(figsize=(film.size[0] / 130, 3 * film.size[1] / 130))
for number in range(3):
    axes = frames.add_axes((0, 1 - (number + 1) / 3, 1, 1 / 3))
    axes.imshow(film.frame(number))
    axes.set_axis_off()
