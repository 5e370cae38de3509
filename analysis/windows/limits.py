"""Every size, share and tolerance of the search for windows, with its reason."""

from dataclasses import dataclass

from ..factors.lanczos import SliceSizes


@dataclass(frozen=True)
class Limits(SliceSizes):
    """Sizes, shares and tolerances of the search; the defaults are meant for packings."""

    # Sizes at which the way changes

    all_windows: int = 300
    """Disks up to which all windows are sought, from all eigenvalues: a second for a decomposition, which grows
    with the cube of the number. Beyond, the first window is sought in slices of the spectrum."""
    dense_factors: int = 600
    """Coordinates up to which a dense factorisation of A - sigma is faster than a sparse one."""
    one_basis: int = 1000
    """Coordinates up to which the basis is one dense decomposition: less than a second. Beyond, it comes in
    slices."""

    # The operator

    unknown_force: float = 10.0
    """A contact counts from this times the packing's imbalance: a disk may rest between two contacts without force,
    whose forces cancel in part."""
    small_force: float = 1e-6
    """A contact counts in any case from this share of the largest force, so that a packing out of balance keeps its
    contacts."""

    # Windows between two loads

    narrowest: float = 1e-7
    """Narrowest window, in units of the largest load: its pair would grow more slowly than any run can show."""
    bend: float = 0.05
    """Curvature that two values and slopes of D do not show, as a share of the smaller D: more than enough for
    loads between which modes are recognised at all."""

    screen_divisions: int = 4
    """How often an increment is divided before all modes are computed, in the time of ten looks at a few modes."""
    change_divisions: int = 1
    """How often an increment is divided in which a pair changes."""
    bend_divisions: int = 3
    """As `change_divisions`, where contacts open or close: levels then leave the straight line at unknown loads."""
    division_share: float = 0.47
    """Where an increment is divided: not in the middle, as the edges of models lie at round numbers."""

    bend_length: float = 2.0**-4
    """Length in increments of the step about a load at which contacts change, in which a window may still hide."""

    # The edge of a window

    root_width: float = 1e-7
    """Width to which the root of D is bracketed, in increments."""
    point_distance: float = 10.0
    """First distance of the five points about a root from each other, in widths of its bracket."""
    point_distance_share: float = 1e-3
    """Largest first distance of these points, as a share of the distance of the root from the nearer end of the
    increment."""
    point_factor: float = 30.0
    """Factor from one distance of these points to the next, where their scatter hides the slope."""
    largest_point_share: float = 0.1
    """Largest of these distances, as a share of the distance of the root from the nearer end of the increment."""
    scatter: float = 0.1
    """Scatter of the five points about their parabola, in units of their slope, beyond which the function is not
    smooth there: a step has 1."""
    jump_width: float = 1e-9
    """Width to which a jump is bracketed, in increments; its place depends on the path's increment by far more."""
    steady_share: float = 1e-9
    """|Im s| below this share of the largest |s| counts as zero."""
    shortest_step: float = 2.0**-6
    """Shortest steps, in shares of the straight line from one operator to another, in which pairs and modes are
    followed."""

    # Inverse iteration of a pair

    steps: int = 40
    """Iterations before a shift is given up: a solution costs a hundredth of a dense decomposition."""
    neighbour_steps: int = 12
    """As `steps`, with the factors of a neighbour: four solutions a step, against a hundred for a factorisation."""
    pace_steps: int = 5
    """Steps by which the pace is judged: the iteration slows down while farther modes go, and then keeps its
    pace."""
    offsets: tuple[float, ...] = (0.1, -0.1, 1.0, -1.0)
    """Distances of the shift from the mean of the pair, in units of its spread, tried in turn. A tenth of the
    spread costs the second direction no more than a digit, and saves half of the iterations; a third eigenvalue may
    be close."""
    shifts: int = 12
    """Shifts for a single mode, whose s is found better with each: one or two are enough."""
    slow_share: float = 0.1
    """Share of a residual that a step may leave before the shift is renewed: a factorisation costs a few steps."""
    off_eigenvalue: float = 1e-9
    """Distance of a shift from a point that may be an eigenvalue to the last digit, as a share: an inverse should
    exist."""
    inverse_steps: int = 6
    """Inverse iterations from random vectors: each takes other modes away by the ratio of their distances."""
    extrapolation: float = 2.0
    """Distance of a load from the nearer of two others up to which planes are extrapolated, in units of the
    distance of these two from each other."""
    same_mode: float = 1e-8
    """Two modes of one load are one and the same if their eigenvalues agree to this share, over their condition."""
    residual_factor: float = 100.0
    """Residual of an accepted plane, in units of u |A|_F; LAPACK's own are some 10."""

    # Screening by perturbation theory

    slack: float = 0.05
    """How far levels and couplings may leave the straight line between two loads, in units of their change. In
    packings of 100 disks and increments of 1e-3 it is 1.3e-3 in the median, and grows with the increment."""
    few_modes: int = 16
    """Modes that are sought in clusters; where more are named, a decomposition of all modes costs no more."""
    cluster_residual: float = 1e5
    """As `residual_factor`, of a cluster: eigenvalues err by its square over the distance of other levels, which is
    rounding if they are farther away than 1e-6 |A|_F."""
    isolation: float = 0.6
    """Half the width of a cluster of few modes over the distance of other levels from its middle: the convergence of
    its subspace, which ten digits leave within `steps`."""
    core: int = 20
    """Modes that a cluster owns."""
    margin: int = 20
    """Further modes of a cluster on either side, coupled to its own in all orders. Farther ones mix by less than a
    hundredth."""
    modes_beyond: int = 10
    """Modes of a slice on either side beyond those of its clusters, in second order. What is farther away changes
    levels by less than (coupling / spacing)^2 / 30 of their spacing."""
    mixing: float = 0.1
    """Typical symmetric coupling within clusters, in level spacings, up to which a basis is used: with other modes
    `margin` spacings away, the second order leaves out (mixing / margin)^2 = 2.5e-5 of the coupling."""

    # Screening of growth with dissipation

    clusters: float = 5e-5
    """Clusters of an increment, for each coordinate squared, beyond which all modes take less time: four of 100
    disks. Half as many in a half, so that dividing costs no more than that at any depth."""
    increment_window: float = 1e-4
    """Narrowest windows that are looked for in clusters, in increments: where they begin is known to 1e-2 or so."""
    weak_damping: float = 0.3
    """A mode of a cluster whose damping is below this share of the median is looked at with the operator, which
    decides."""
    overshoot: float = 0.05
    """Share of an increment by which a cluster is followed beyond the upper load: a cluster knows to 1e-2 or so of
    an increment where modes begin to grow. What grows there is looked at with the operator, too."""
    third_order: float = 5.0
    """Third order, in units of the root of its sum of squares: its terms have random signs."""
    spare: float = 0.1
    """Share of a mode's own damping that has to be left."""
    largest_mixing: float = 0.25
    """Mixing of two modes up to which the second order is trusted: what is left out is of the relative order of its
    square, 0.06."""
    oscillation_damping: float = 0.3
    """Damping over frequency up to which a mode counts as oscillating."""
    dissipation_share: float = 0.7
    """Share of the energy that dashpots take, which has to exceed the energy that feeds the motion: a cluster knows
    both to a few per cent."""
    suspect_distance: int = 10
    """Suspects that are closer belong to one cluster."""

    largest_cluster: int = 100
    """Modes of a cluster with dissipation; beyond, all modes take no longer."""
    largest_share: float = 1 / 3
    """As `largest_cluster`, as a share of all modes; the larger of both counts."""

    # Slices of the spectrum

    count_spacing: int = 240
    """Eigenvalues between two places at which they are counted; shifts are interpolated in between."""
    # The search in slices

    cluster_reach: float = 0.1
    """Share of an increment by which clusters are extrapolated, so that a pair that they have turn complex a little
    late is found in time. Clusters are trusted as long as they are right to twice that."""
    cluster_window: float = 1e-3
    """Narrowest windows of clusters that are looked for, in increments: the clusters' own error is larger."""
    coupling_excess: float = 0.2
    """Number added to the antisymmetric couplings of a cluster, in units of mixing^2 times the spacing of its levels,
    so that pairs are announced early, and the operator decides. Modes beyond a slice, and the third order, change the
    difference of both couplings by a tenth of that unit (360 disks)."""
    dips: int = 12
    """Looks at the discriminant of an announced pair before its sign is in doubt; an avoided crossing takes one or
    two."""
    parts: int = 4
    """Parts of a doubtful increment: four cost little more than two while a basis passes by."""
    depth: int = 2
    """How often parts are divided again; the finest are a sixteenth."""
    largest_basis: float = 3e8
    """Numbers of a basis that is kept from increment to increment, 3.6 GB in double and in single precision
    together."""
    increments_ahead: int = 2
    """Increments that are looked at while a basis that is not kept passes by: each costs a twentieth of the
    basis."""
    lapack_coordinates: int = 5000
    """Coordinates up to which all eigenvalues at the first load are asked for: half a minute, and as their cube."""
    axis_coordinates: int = 10_000
    """Coordinates up to which all motions that grow at a load are looked for along the imaginary axis, where
    clusters miss some: the time grows as their square."""
    wait_seconds: float = 2.0
    """Seconds between two looks at the results of other searches, when these have taken all slices that are left."""
    # Growth with dissipation, in slices

    bearing_share: float = 0.5
    """Share of the antisymmetric part that a slice bears, up to which the slice is left out: its modes change on the
    way."""
    bearing_factor: float = 1.3
    """Factor of the load: where further slices have to be looked at, slices that would have to be looked at up to this
    factor are looked at, too, since kept bases are made anew."""
    most_increments_ahead: int = 8
    """Increments at the most that are looked at while bases that are not kept pass by."""
    places: int = 6
    """Looks at an announced mode, for a load at which it grows."""
    nearest_modes: int = 12
    """Modes about a frequency among which a growing one is looked for if a cluster does not know its shape."""
    stride: int = 2
    """Ratio of the numbers of two loads at which all motions are looked for: a look takes as long as two passes or
    more."""
    below_onset: float = 1e-6
    """Distance below an onset at which all other motions are looked for, in units of the way from the last load
    without."""
    place_tolerance: float = 0.02
    """Share of an increment by which the place of the largest growth may still move."""

    # Discs along the imaginary axis

    krylov: int = 40
    """Dimension of a Krylov space: 80 cost a fifth more for the same length of the axis, 20 do not reach far
    enough."""
    ritz_residual: float = 1e-3
    """Residual of an eigenvalue that counts as found, in units of its own: that of single precision is some
    1e-4."""
    pivot: float = 0.01
    """Share of the largest entry of a column from which on the diagonal entry is the pivot."""
    covered_share: float = 0.9
    """Share of the radius on the axis that counts as covered."""
    next_disc: float = 0.8
    """Distance of a new middle from what is covered, in units of the last disc's radius, as radii change."""
    stray_share: float = 0.05
    """Distance between an eigenvalue and its refined value, in units of the distance from the middle, beyond which they
    are two eigenvalues."""
    norm_error: float = 1e-2
    """Share to which norms are found, and by which they are taken larger."""
    smallest_disc: float = 1e-6
    """Radius, in units of the largest frequency, below which the axis cannot be covered."""


LIMITS = Limits()
"""The defaults."""
