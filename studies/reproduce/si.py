"""What a report's numbers are for the grains of [units]."""

from __future__ import annotations

from ...pywrap import Scene
from ...pywrap.onset.undamped import OnsetRun
from ...pywrap.scenes.units import RealUnits, dashpot, quality_factor, real_units
from ..triggering import Triggering, column
from .compute import GrowthRun, TriggeringRun

Row = tuple[str, str, str]
"""A quantity, its number in the scene, and the number with its SI unit."""


def si_rows(scene: Scene, runs: list[OnsetRun], growth: GrowthRun, triggered: TriggeringRun | None) -> list[Row]:
    """The column in SI of report.md, a row a quantity; none if the scene has no units. Arguments as of `report`."""
    real = real_units(scene)
    if real is None:
        return []
    rows = [("F_y, the overburden", f"{real.fy:g}", f"{1e-6 * real.overburden:.4g} MPa")]
    for run in runs:
        first = run.onset.windows[0]
        omega = abs(first.eigenvalue) ** 0.5
        stress, ratio, frequency = real.onset(first.fx_onset, omega).values()
        rows += [
            (
                f"F_x^c for mu = {run.mu:g}, a shear stress",
                f"{first.fx_onset:.6g}",
                f"{1e-6 * stress:.4g} MPa, {ratio:.4g} of the overburden",
            ),
            ("frequency of the pair there", f"{omega:.4g}", f"{frequency:.4g} Hz"),
        ]
    rows += _growth(real, growth) + _dashpot(scene, real)
    if triggered is not None and triggered.triggering is not None and triggered.scene is scene:
        rows += _wave(real, triggered.triggering, triggered.settings.amplitude, triggered.settings.omega or 0.0)
    return rows


def _growth(real: RealUnits, growth: GrowthRun) -> list[Row]:
    pair = max(growth.spectrum.pairs, key=lambda each: each.growth_rate)
    rate = 0.5 * pair.growth_rate
    largest = float(growth.msd.max())
    return [
        ("time in which the fastest motion grows e-fold", f"{1 / rate:.4g}", f"{real.time / rate:.3g} s"),
        (
            "quality factor below which nothing grows, Re omega / 2 Im omega",
            f"{quality_factor(rate + 1j * pair.frequency):.4g}",
            "the same",
        ),
        ("root of the largest D of the undamped run", f"{largest**0.5:.3g}", f"{real.displacement(largest):.3g} m"),
        ("its length", f"{growth.time[-1]:.4g}", f"{real.time * growth.time[-1]:.3g} s"),
    ]


def _dashpot(scene: Scene, real: RealUnits) -> list[Row]:
    """C_N of the restitution that is given."""
    units = scene.units
    if units is None or units.restitution is None:
        return []
    velocity = units.si("impact_velocity") / real.velocity(1.0)
    wanted = dashpot(scene.law.kn, units.restitution, 1.0, velocity)
    return [("dashpot C_N of the restitution", f"{wanted:.4g}", f"{units.restitution:g} at {units.impact_velocity}")]


def _wave(real: RealUnits, found: Triggering, amplitude: float, omega: float) -> list[Row]:
    ground = real.ground_velocity(amplitude, omega, "layer")
    largest = float(column(found.erupting, "msd").max())
    return [
        ("amplitude of the wave, as ground velocity", f"{amplitude:g}", f"{ground:.3g} m/s"),
        ("its frequency", f"{omega:g}", f"{real.frequency(omega):.3g} Hz"),
        (
            "v_0, above which friction weakens",
            f"{found.weakening.v0:.3g}",
            f"{real.velocity(found.weakening.v0):.3g} m/s",
        ),
        ("root of the largest D with mu(v)", f"{largest**0.5:.3g}", f"{real.displacement(largest):.3g} m"),
    ]
