"""Sizes of the search of large packings, in slices of the spectrum, with their reasons."""

from dataclasses import dataclass

from ..factors.lanczos import SliceSizes


@dataclass(frozen=True)
class Limits(SliceSizes):
    """Sizes and tolerances; the defaults are meant for packings."""

    all_windows: int = 300
    """Disks up to which all windows are sought, from all eigenvalues: half a second for a decomposition, which grows
    with the cube of the number. Beyond, the first window is sought in slices of the spectrum."""
    one_basis: int = 1000
    """Coordinates up to which the basis is one dense decomposition: less than a second. Beyond, it comes in
    slices."""
    count_spacing: int = 240
    """Eigenvalues between two places at which they are counted; shifts are interpolated in between."""
    margin: int = 30
    """Further modes of a slice on either side, coupled to its own in all orders. What is farther away changes levels by
    less than (coupling / spacing)^2 / 30 of their spacing."""
    mixing: float = 0.1
    """Typical symmetric coupling within a slice, in level spacings, up to which its basis serves at other loads."""
    reach: float = 0.1
    """Share of an increment by which slices are extrapolated, so that a motion that a slice has grow a little late is
    found in time. Announced onsets are trusted to twice that."""
    window: float = 1e-3
    """Narrowest windows of slices that are looked for, in increments: the slices' own error is larger."""
    excess: float = 0.2
    """Number added to the antisymmetric couplings of a slice, in units of mixing^2 times the spacing of its levels."""
    parts: int = 4
    """Parts of a doubtful increment: four cost little more than two while a basis passes by."""
    depth: int = 2
    """How often parts are divided again; the finest are a sixteenth."""
    largest_basis: float = 3e8
    """Numbers of a basis that is kept from increment to increment, 2.4 GB."""
    increments_ahead: int = 2
    """Increments that are looked at while a basis that is not kept passes by: each costs a twentieth of the basis."""
    wait_seconds: float = 2.0
    """Seconds between two looks at the results of other searches, when these have taken all slices that are left."""


LIMITS = Limits()
"""The defaults."""
