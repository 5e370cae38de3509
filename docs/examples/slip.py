"""A spring draws the upper layer of 40 disks, which sticks and slips; the spectrum says what grows before a slip.

The far end of the spring moves slowly. The layer holds until it gives way, and the force of the spring falls.
"""

from faultgouge import Scene, drive, settle, spectrum

scene = Scene.from_mapping(
    {
        "packing": {"seed": 6, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "damping": {"cn": 60.0, "ct": 17.0},
        "drive": {"spring": 10.0, "velocity": 2e-3, "until": 200.0},
    }
)

states, slips, largest = [], [], 0.0
for step in drive(scene, settle(scene).packing):
    states += step.states
    largest = max(largest, step.sample.force)
    if step.slip is not None:
        slips.append(step.slip)

for slip in slips:
    print(
        f"t = {slip.begins:.1f} to {slip.ends:.1f}: the layer slips by {slip.slip:.4f}, "
        f"and the force falls from {slip.force_before:.3f} to {slip.force_after:.3f}"
    )
before = min(states, key=lambda state: abs(state.time - slips[0].begins))
print(f"largest force of the spring {largest:.3f}, on each disk of the layer")
print(
    f"complex pairs at rest: {len(spectrum(states[0].packing).pairs)}, at t = {before.time:.1f}, before the first slip:"
    f" {len(spectrum(before.packing).pairs)}"
)
