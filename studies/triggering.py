r"""Remote triggering: a linearly stable packing just below its onset that erupts once friction weakens with velocity.

Between the onsets of two friction coefficients, mu mu_ss and mu, a packing is stable with the larger and unstable with
the smaller one. Three undamped runs from the same equilibrium show what a minute perturbation a cos(omega t) does
there: nothing without it; a small bounded response with it; and an eruption where it sets the upper layer into motion
that is fast enough to weaken the friction, mu(v), of all contacts.

A rise of D alone is no instability. As soon as mu(v) has fallen, every contact that carries tangential load carries
less of it, and the equilibrium is elsewhere: D *jumps* to the square of that distance, in a packing that is stable with
the weakened friction as well. A control run says how far: mu(v) at a force as far below the onset of the weakened
friction as the run is above it. What tells an instability from the jump is that D *grows* on after it.

Closer and closer to the onset, the response of the pair that is about to coalesce grows as
:math:`\epsilon^{-1/2}`, and damping cuts it off where its time tau falls below :math:`\tau_d`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis import RunFile
from ..analysis.normal_form import PairForm, PowerLaw, fit_power_law, pair_forms
from ..analysis.response import Response, layer_force, linear_response
from ..pywrap import Equilibrium, Sample, Scene
from ..pywrap.engine import Weakening
from ..pywrap.scene import Friction, Perturb
from ..pywrap.stages import perturb, time_step, weakening_of
from .onsets import OnsetRun

Floats = NDArray[np.float64]

JUMP_SHARE = 0.05
"""Share of the run with mu(v) that shows the jump: 10 of 200 time units, where the slowest modes of 100 disks have
periods of 6, and the fastest pairs have just begun to stand out."""

GROWTH_FACTOR = 2.0
"""Factor from the jump to the largest D from which on D has grown. Without an instability, the phases in which many
modes happen to meet change the maximum by some ten percent."""

ABOVE_NOISE = 1e3
"""How much stronger the perturbation is that is compared with the linear response: a million times in D."""

COMPARED_TIME = 50.0
"""Length of that run, time: a few hundred periods of the pair."""


@dataclass(frozen=True, eq=False)
class Triggering:
    """Three undamped runs from one equilibrium.

    Attributes
    ----------
    start : Equilibrium
        Linearly stable.
    weakening : Weakening
        mu(v), with v_0 the largest velocity of the unperturbed run.
    unperturbed, perturbed, erupting : tuple of Sample
        Without perturbation, with it, and with it and mu(v).
    control : tuple of Sample or None
        As the last, at a force where the packing is stable with the weakened friction, too; None if none is known.
    strong : tuple of Sample
        With a perturbation `ABOVE_NOISE` as strong, for a shorter time: its D stands out of the noise of doubles and is
        compared with the linear response.
    response : Response
        Of the linearised packing to that perturbation, time step included.
    """

    start: Equilibrium
    weakening: Weakening
    unperturbed: tuple[Sample, ...]
    perturbed: tuple[Sample, ...]
    erupting: tuple[Sample, ...]
    control: tuple[Sample, ...] | None
    strong: tuple[Sample, ...]
    response: Response

    @property
    def deviation(self) -> float:
        """Largest difference between D of the strong run and of the linear response, in units of the largest D."""
        msd = column(self.strong, "msd")
        return float(np.abs(msd - self.response.msd).max() / msd.max())

    @property
    def rise(self) -> float:
        """Decades between the largest D of the perturbed run and of the one with mu(v)."""
        return float(np.log10(column(self.erupting, "msd").max() / column(self.perturbed, "msd").max()))

    @property
    def grows(self) -> bool:
        """Whether D goes on to grow after its jump."""
        return bool(column(self.erupting, "msd").max() >= GROWTH_FACTOR * jump(self.erupting))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Response of the pair that is about to coalesce, over the distance from the onset.

    Attributes
    ----------
    distance : ndarray, shape (n,)
        1 - F_x/F_x^c.
    pairs : tuple of PairForm
        The pair at these distances.
    fit : PowerLaw
        Of the undamped amplitude over the distance.
    """

    distance: Floats
    pairs: tuple[PairForm, ...]
    fit: PowerLaw

    @property
    def amplitude(self) -> Floats:
        """Undamped amplitudes in units of the start, shape (n,)."""
        return np.array([pair.amplitude() for pair in self.pairs])


def column(samples: tuple[Sample, ...], name: str) -> Floats:
    """One quantity of a time series, shape (T,)."""
    return np.array([getattr(sample, name) for sample in samples])


def jump(samples: tuple[Sample, ...]) -> float:
    """The largest D in the first `JUMP_SHARE` of a run, length^2."""
    time, msd = column(samples, "time"), column(samples, "msd")
    return float(msd[time <= JUMP_SHARE * time[-1]].max())


def trigger(
    scene: Scene,
    start: Equilibrium,
    below: Equilibrium | None,
    settings: Perturb,
    friction: Friction,
    path: Path,
) -> Triggering:
    """The runs, written to run.h5 as they end, and the linear response beside the last.

    Parameters
    ----------
    scene : Scene
        The scene.
    start : Equilibrium
        At settings.fx.
    below : Equilibrium or None
        Where the control starts.
    settings : Perturb
        The perturbation and the length of the runs.
    friction : Friction
        mu(v).
    path : Path
        run.h5 of the ramp; gets the series unperturbed, perturbed, erupting, control and strong.
    """

    def run(
        name: str,
        amplitude: float,
        weakening: Weakening | None = None,
        time: float = settings.time,
        start: Equilibrium = start,
    ) -> tuple[Sample, ...]:
        one = settings.model_copy(update={"amplitude": amplitude, "time": time})
        samples = tuple(perturb(scene.model_copy(update={"perturb": one}), start, weakening=weakening))
        with RunFile(path, "a") as file:
            file.append_series(name, **{key: column(samples, key) for key in vars(samples[0])})
        return samples

    unperturbed = run("unperturbed", 0.0)
    v0 = np.abs(column(unperturbed, "layer_velocity")).max() if isinstance(friction.v0, str) else friction.v0
    weakening = weakening_of(friction, float(v0))
    perturbed = run("perturbed", settings.amplitude)
    erupting = run("erupting", settings.amplitude, weakening)
    control = None if below is None else run("control", settings.amplitude, weakening, start=below)
    amplitude = ABOVE_NOISE * settings.amplitude
    strong = run("strong", amplitude, time=min(settings.time, COMPARED_TIME))
    packing = start.packing
    response = linear_response(
        packing,
        column(strong, "time"),
        force=layer_force(packing, amplitude),
        omega=settings.omega or 0.0,
        dt=time_step(packing, settings.time_step),
    )
    return Triggering(start, weakening, unperturbed, perturbed, erupting, control, strong, response)


def sensitivity(run: OnsetRun) -> Sensitivity:
    """The pair of the first onset, at the equilibria that the run has just below it."""
    first = run.onset.windows[0]
    below = sorted((fx for fx in run.between if fx < first.fx_onset), reverse=True)
    # nearer than a hundred times the onset's own error, the distance is not known
    below = [fx for fx in below if first.fx_onset - fx > 100 * first.error]
    pairs = tuple(pair_forms([run.between[fx] for fx in below], first.eigenvalue))
    distance = 1 - np.array(below) / first.fx_onset
    return Sensitivity(distance, pairs, fit_power_law(distance, [pair.amplitude() for pair in pairs]))


def figures(triggering: Triggering, sensitive: Sensitivity, mu: float, output: Path) -> None:
    """The paper's figures 2, 5 and 6, and two of the response: over the distance from the onset, and over damping."""
    from . import triggering_figures as draw
    from .figures import save

    weak = triggering.weakening
    law = draw.FrictionLaw(mu_0=mu, B=weak.B, w=weak.w, mu_ss=weak.mu_ss, v_0=weak.v0, v_ss=weak.v_ss)
    curves = {
        name: draw.Displacements(column(getattr(triggering, name), "time"), column(getattr(triggering, name), "msd"))
        for name in ("unperturbed", "perturbed", "erupting")
    }
    save(draw.friction_law_figure(draw.FrictionLaw(mu_0=mu, B=weak.B, w=weak.w, mu_ss=weak.mu_ss)), output / "figure2")
    save(
        draw.eruption_figure(curves["unperturbed"], curves["perturbed"], curves["erupting"]),
        output / "figure5a",
    )
    speed, friction = (column(triggering.erupting, name) for name in ("layer_velocity", "friction"))
    save(draw.weakening_figure(np.abs(speed), friction, law), output / "figure5b")
    save(draw.measured_friction_figure(), output / "figure6")

    strong = draw.Displacements(column(triggering.strong, "time"), column(triggering.strong, "msd"))
    linear = draw.Displacements(triggering.response.time, triggering.response.msd)
    save(draw.response_figure(strong, linear), output / "response")

    reach = (float(sensitive.distance.min()), float(sensitive.distance.max()))
    curve = draw.AmplitudeCurve("$1 - F_x/F_x^c$", sensitive.distance, sensitive.amplitude, sensitive.fit, reach)
    save(draw.amplitude_figure([curve]), output / "amplitude")
    chosen = [sensitive.pairs[k] for k in np.linspace(0, len(sensitive.pairs) - 1, 4).astype(int)]
    save(draw.damping_figure([_damping_curve(pair) for pair in chosen]), output / "damping")


def _damping_curve(pair: PairForm) -> Any:
    from .triggering_figures import DampingCurve

    damping_time = pair.tau_d * np.geomspace(1e-2, 1e2, 33)
    return DampingCurve(
        epsilon=pair.form.epsilon,
        damping_time=damping_time,
        amplitude=np.array([pair.amplitude(tau) for tau in damping_time]),
        undamped=pair.amplitude(),
        tau_d=pair.tau_d,
        half_time=pair.half_gain_time(),
    )


def summary(triggering: Triggering, sensitive: Sensitivity) -> dict[str, Any]:
    """Numbers for summary.json."""
    largest = {
        name: float(column(getattr(triggering, name), "msd").max()) for name in ("unperturbed", "perturbed", "erupting")
    }
    return {
        "fx": triggering.start.fx,
        "v0": triggering.weakening.v0,
        "v_ss": triggering.weakening.v_ss,
        "largest_D": largest,
        "rise_in_decades": triggering.rise,
        "jump": jump(triggering.erupting),
        "grows_after_the_jump": triggering.grows,
        "largest_D_of_the_control": None
        if triggering.control is None
        else float(column(triggering.control, "msd").max()),
        "linear_response_deviation": triggering.deviation,
        "smallest_mu": float(column(triggering.erupting, "friction").min()),
        "amplitude_exponent": sensitive.fit.exponent,
        "amplitude_exponent_error": sensitive.fit.error,
        "distances": [float(sensitive.distance.min()), float(sensitive.distance.max())],
        "half_gain_time_over_tau_d": [pair.half_gain_time() / pair.tau_d for pair in sensitive.pairs],
    }


def _jump_words(triggering: Triggering) -> list[str]:
    first, largest = jump(triggering.erupting), column(triggering.erupting, "msd").max()
    jumped = np.log10(first / column(triggering.perturbed, "msd").max())
    lines = [
        f"Of that, {jumped:.1f} decades are a jump, to {first:.1e} in the first twentieth of the run: weak contacts "
        "carry less, and the equilibrium is elsewhere."
    ]
    if triggering.control is not None:
        control = column(triggering.control, "msd").max()
        lines.append(
            f"In the control run, below both onsets and so stable with weakened friction, too, D reaches {control:.1e}."
        )
    grown = f"It then grows {largest / first:.1f}-fold: an instability, and not the jump alone."
    still = "It does not grow after the jump: with weakened friction the packing is stable, or grows too slowly to see."
    return [*lines, grown if triggering.grows else still]


def words(triggering: Triggering, sensitive: Sensitivity, settings: Perturb, mu: float) -> list[str]:
    """Lines of the report."""
    largest = summary(triggering, sensitive)["largest_D"]
    weak = triggering.weakening
    speed = np.abs(column(triggering.erupting, "layer_velocity"))
    return [
        "## Triggering",
        "",
        f"At F_x = {triggering.start.fx:g} the packing is linearly stable with mu = {mu:g}. Three undamped runs of "
        f"t = {settings.time:g} from there:",
        "",
        "| run | largest D |",
        "|---|---|",
        f"| unperturbed | {largest['unperturbed']:.1e} |",
        f"| perturbed by {settings.amplitude:g} cos({settings.omega:g} t) on the upper layer | "
        f"{largest['perturbed']:.1e} |",
        f"| perturbed, with mu(v) | {largest['erupting']:.1e} |",
        "",
        f"mu(v) falls from {mu:g} towards {mu * weak.mu_ss:g} once |v| > v_0 = {weak.v0:.2g} (the largest velocity of "
        f"the unperturbed run), over v_ss = {weak.v_ss:.2g}; the lowest mu in the run is "
        f"{column(triggering.erupting, 'friction').min():.4g}, the velocity reaches {speed.max():.1e}.",
        f"With mu(v), D rises {triggering.rise:.1f} decades above the perturbed run.",
        *_jump_words(triggering),
        "",
        "![D(t) of the three runs](figure5a.png) ![mu over v](figure5b.png) ![the law](figure2.png)",
        "",
        f"The linear response of the packing, from its K alone, meets LAMMPS within {triggering.deviation:.1e} of the "
        f"largest D under a perturbation {ABOVE_NOISE:g} times as strong (figure `response`).",
        "",
        "![linear response and LAMMPS](response.png)",
        "",
        "Below the onset, the response of the pair that is about to coalesce grows as a power of the distance "
        f"1 - F_x/F_x^c: the exponent is {sensitive.fit.exponent:.4f} +- {sensitive.fit.error:.1g} over distances from "
        f"{sensitive.distance.min():.1e} to {sensitive.distance.max():.1e}; theory has -1/2.",
        "Damping leaves half of it where tau = "
        f"{np.mean([pair.half_gain_time() / pair.tau_d for pair in sensitive.pairs]):.3f} tau_d.",
        "",
        "![amplitude over distance](amplitude.png) ![amplitude over damping](damping.png)",
        "",
        "The paper's figure 6 compares mu(v) with data that are not public; figure6.png has its fitted law alone.",
        "",
    ]
