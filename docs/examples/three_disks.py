"""Three disks: nine eigenvalues, and the load at which two of them merge."""

from faultgouge.analysis import find_onset, spectrum
from faultgouge.pywrap import Engine, Scene, equilibrate, ramp

scene = Scene.from_mapping(
    {
        "packing": {"disks": 3, "radii": [0.5], "top": 1, "width": 2.8},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 0.05, "until": 2.4},
    }
)
states = list(ramp(scene))  # equilibria at F_x = 0, 0.05, ..., 2.4
print("at F_x = 0:", sorted(spectrum(states[0].packing).eigenvalues.real.round(1).tolist()))

with Engine(states[0].packing) as engine:

    def packing_at(fx):
        """The equilibrium at fx, from the one below it: friction remembers the way."""
        below = [state for state in states if state.fx <= fx][-1]
        return equilibrate(engine, below, fx=fx).packing

    onset = find_onset(packing_at, [state.fx for state in states])
print(f"two eigenvalues merge at F_x = {onset.fx_c:.8f}, at {onset.windows[0].eigenvalue:.2f}")
