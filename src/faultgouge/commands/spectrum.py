"""The command spectrum: whether a stored packing is stable, and its eigenvalues."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from .stability import Follow, verdict_of
from .terminal import (
    RAMPED,
    AsJson,
    Frame,
    PackingFile,
    Time,
    frame_at,
    print_json,
    say,
    status,
    stored_packing,
)

if TYPE_CHECKING:
    from ..analysis import Spectrum, Stability
    from ..analysis.has_configuration import HasConfiguration

app = typer.Typer()

MOST_PAIRS = 20
"""Lines of complex pairs: a packing of a thousand has hundreds."""

VERDICT_FIRST = 2000
"""Coordinates beyond which the eigenvalues take longer than the verdict, which does not need them."""


@app.command(epilog=f"Example: {RAMPED} && faultgouge spectrum run.h5 --json")
def spectrum(
    file: PackingFile,
    frame: Frame = -1,
    time: Time = None,
    values: Annotated[
        bool, typer.Option("--values", help="Only the eigenvalues: for a thousand disks in a third of the time.")
    ] = False,
    gain: Annotated[
        bool,
        typer.Option(
            "--gain", help="Also how much a stable packing amplifies its worst push; up to 300 disks or 150 spheres."
        ),
    ] = False,
    rise: Annotated[
        bool, typer.Option("--rise", help="Also the motion while F_x rises slowly: drift and vibration over its rate.")
    ] = False,
    follow: Follow = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Also conditions of pairs, quality factors, what makes K asymmetric.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say whether a stored packing is stable; compute its eigenvalues, complex pairs and rattlers.

    The verdict comes first: with the packing's own dashpots and drag, and with
    contacts at Coulomb's bound as they are, which slide on ahead and stick on the
    way back. The eigenvalues are those of K alone, without dissipation.
    """
    from faultgouge.analysis import spectrum as eigenvalues_of
    from faultgouge.analysis.progress import show_progress

    if values and (gain or rise or verbose or follow):
        raise typer.BadParameter(
            "--values computes nothing but eigenvalues: leave --gain, --rise, --follow and --verbose out"
        )
    number = frame_at(file, frame, time)
    packing = stored_packing(file, number)
    if rise and not packing.configuration.top.any():
        raise typer.BadParameter(f"--rise: {file} has no upper layer that a load could push; leave it out")
    if not is_root():
        return
    size = packing.configuration.coordinates
    large = size > VERDICT_FIRST
    if values:
        if large:  # four matrices of doubles; 18000 coordinates took 10.2 GB
            say(f"{size} coordinates: LAPACK needs {32e-9 * size**2:.2g} GB, and a time that grows as their cube")
        _values(packing, as_json)
        return
    result = None if large else eigenvalues_of(packing)
    verdict = verdict_of(packing, "fx" if rise else None, spectrum_of_stiffness=result, follow=follow)
    if not as_json:
        print(verdict, flush=True)
    if result is None:
        with status("eigenvalues of K") as show, show_progress(show):
            result = eigenvalues_of(packing)
    gains = _gain_of(packing) if gain else None
    if not as_json:
        _print_spectrum(packing, result, verdict, gains, verbose)
        return
    print_json(_as_json(packing, result, verdict, gains))


def _as_json(
    packing: HasConfiguration, result: Spectrum, verdict: Stability, gain: dict[str, Any] | None
) -> dict[str, Any]:
    """The document that docs/json.md explains."""
    from faultgouge.analysis import Packing, solid_fraction

    names = ("condition", "overlap", "growth_rate", "frequency", "quality", "participation", "rotation")
    return {
        "stability": verdict.as_dict(),
        "eigenvalues": [[value.real, value.imag] for value in result.eigenvalues.tolist()],
        "pairs": [
            {"eigenvalue": [pair.eigenvalue.real, pair.eigenvalue.imag]} | {name: getattr(pair, name) for name in names}
            for pair in result.pairs
        ],
        "pair_count": len(result.pairs),
        "least_q": result.least_q if result.pairs else None,
        "negative": result.negative.tolist(),
        "stable": verdict.stable,
        "largest_growth_rate": result.growth_rate(),
        "rattlers": result.rattlers.tolist(),
        "fx": packing.configuration.fx,
        "spring": packing.configuration.spring,
        "residual": packing.residual,
        "solid_fraction": solid_fraction(packing) if isinstance(packing, Packing) else None,
        "noise_pairs": result.noise_pairs,
        "transient_gain": gain,
    }


def _values(packing: HasConfiguration, as_json: bool) -> None:
    """Eigenvalues without vectors: as JSON, or a line each."""
    from faultgouge.analysis import eigenvalues

    found = [[value.real, value.imag] for value in eigenvalues(packing).tolist()]
    if as_json:
        print_json({"eigenvalues": found, "rattlers": packing.rattlers.tolist(), "fx": packing.fx})
        return
    for real, imaginary in found:
        print(f"{real:.17g} {imaginary:.17g}")


def _print_spectrum(
    packing: HasConfiguration,
    result: Spectrum,
    verdict: Stability,
    gain: dict[str, Any] | None,
    verbose: bool,
) -> None:
    _print_size(packing, result)
    _print_growing_motions(result, verdict.dissipative, verbose)
    if gain is not None:
        print(
            f"a displacement from rest grows by up to {gain['displacement']:.6g} times in its square, within t = "
            f"{gain['time']:.6g} (by up to {gain['energy']:.6g} in energy); disk {gain['disk']} is the worst to push"
            if gain["displacement"] > 1
            else "no displacement from rest grows"
        )
        if not gain["linear"]:
            print("this is the gain of K alone, in which each contact has one derivative; these contacts have two")
    if verbose:
        shares = ", ".join(f"{name.replace('_', ' ')} {share:.3g}" for name, share in verdict.asymmetry.items())
        print(f"what makes K asymmetric, as shares: {shares}")
        if result.noise_pairs:
            print(
                f"{counted(result.noise_pairs, 'pair')} of eigenvalues with imaginary parts within the rounding error: "
                "they count as real"
            )
    if spring := packing.configuration.spring:
        print(f"K has the stiffness of the spring that draws the layer, {spring:g} on each of its disks")


def _print_size(packing: HasConfiguration, result: Spectrum) -> None:
    """The packing, and the range of its eigenvalues."""
    from faultgouge.analysis import Packing, solid_fraction

    real = result.eigenvalues.real
    if isinstance(packing, Packing):
        what, fraction = f"F_x = {packing.fx:g}", f"; volume fraction {solid_fraction(packing):.4f}"
    else:
        noun = "sphere" if packing.dimension == 3 else "disk"
        what, fraction = f"{counted(len(packing), noun)} as LAMMPS left {'it' if len(packing) == 1 else 'them'}", ""
    span = f" from {real.min():.6g} to {real.max():.6g}" if len(real) else ", as no particle touches another"
    numbers = f"{counted(len(real), 'eigenvalue')} of K{span}, {counted(len(result.rattlers), 'rattler')} left out"
    print(f"{what}: {numbers}{fraction}")


def _print_growing_motions(result: Spectrum, dissipative: bool, verbose: bool) -> None:
    from faultgouge.analysis import growth_rate

    alone = " without dissipation" if dissipative else ""
    for value in result.negative:
        print(f"negative eigenvalue {value:.10g}: D grows as exp({growth_rate(value):.6g} t){alone}, no oscillation")
    for pair in result.pairs[:MOST_PAIRS]:
        condition = f", |y^H x| = {pair.overlap:.2g}" if verbose else ""
        print(
            f"complex pair {pair.eigenvalue.real:.10g} +- {pair.eigenvalue.imag:.10g} i: "
            f"D grows as exp({pair.growth_rate:.6g} t){alone}{condition}"
        )
    if len(result.pairs) > MOST_PAIRS:
        print(f"and {len(result.pairs) - MOST_PAIRS} more: --json has all {len(result.pairs)}")
    if result.pairs and verbose:
        print(f"least Q of a pair, |Re omega| / (2 |Im omega|): {result.least_q:.4g}")


def _gain_of(packing: HasConfiguration) -> dict[str, Any] | None:
    """The transient gains of a stable packing; None, with the reason, if unstable, too large, or where it fails."""
    from faultgouge.analysis.responses.transient import GAIN_DISKS, NoGainError, transient_gains

    most, size = 3 * GAIN_DISKS, packing.configuration.coordinates
    if size > most:
        say(f"no gain: it is computed of up to {most} coordinates, and this packing has {size}")
        return None
    try:
        displacement, energy = transient_gains(packing)
    except NoGainError as error:
        say(f"no gain: {error}")
        return None
    except Exception as error:  # whatever it is: the eigenvalues are worth more
        reason = (str(error).splitlines() or ["no reason given"])[0]
        say(f"the transient gain was not found ({type(error).__name__}: {reason}); the eigenvalues are complete")
        return None
    names = ("time", "window", "bound", "disk", "linear")
    gains = {"displacement": displacement.gain, "energy": energy.gain}
    return (
        gains | {name: getattr(displacement, name) for name in names} | {"direction": displacement.direction.tolist()}
    )
