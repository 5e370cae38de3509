"""The sections of a scene that belong to one study each: [trigger], [eruptions] and [modes]."""

from typing import Annotated, Literal

from pydantic import Field

from .validation import Positive, Section

Share = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class Trigger(Section):
    """[trigger] which waves trigger how critical a layer.

    Attributes
    ----------
    distance : tuple of float
        Distances 1 - F_x/F_x^c from the onset.
    omega : tuple of float or None
        Angular frequencies of the wave, 1 / time. None: `COUNT` of them, evenly over the logarithm, from a tenth of the
        slowest mode's to the fastest mode's.
    time : float
        How long the wave lasts, time.
    runs : int
        How many pairs of a distance and a frequency are bisected in LAMMPS.
    on : {"layer", "floor"}
        What the wave is: a force a cos(omega t) on each disk of the upper layer, or an acceleration of the floor.
    """

    distance: Annotated[tuple[Share, ...], Field(min_length=1, strict=False)] = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4)
    omega: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)] | None = None
    time: Positive = 20.0
    runs: int = Field(12, ge=0)
    on: Literal["layer", "floor"] = "layer"


class Eruptions(Section):
    """[eruptions] undamped runs from rest until they are over.

    Attributes
    ----------
    load : tuple of float
        F_x of the equilibria from which the runs start, force on each disk of the upper layer. Loads beyond the last
        equilibrium are left out.
    time : float
        Length of a run at the most, time.
    """

    load: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)]
    time: Positive = 3000.0


class ModesSection(Section):
    """[modes] the complex pairs along the ramp.

    Attributes
    ----------
    fx_over_fy : tuple of float
        Loads at which all eigenvalues are taken, in units of F_y. Those beyond the last equilibrium are left out.
    """

    fx_over_fy: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)] = (
        0.003,
        0.01,
        0.02,
        0.03,
        0.05,
        0.1,
        0.14,
        0.2,
        0.25,
        0.3,
        0.35,
        0.4,
    )
