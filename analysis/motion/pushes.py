r"""Small motion after pushes, contacts at Coulomb's bound as they are: does it grow, or come to rest?

Motions begin with random pushes of all particles, and with the opposites of these pushes, since one-sided motion is not
odd (:mod:`~faultgouge.analysis.motion.one_sided`). Six numbers decide:

- steps of `VERDICT_STEP`, in chunks of `CHUNK` stable steps, some ten periods of a slow mode;
- a motion *grows* if its kinetic energy, a mean over a tenth of a chunk, has grown to `GROWN_ENERGY` times that of the
  first tenth. No motion that no force opposes does: the energy of a particle that sliders have let go grows as the
  square of the time;
- a motion *rests* if sticking contacts do not grow, and the sliders have come to rest: with the slips of the last three
  quarters of the time, and the ratio by which these fall, a share below `STILL_SHARE` of all slip is left to come;
- it *has not settled* otherwise, after 120 chunks, or `WORK_OF_MOTION` multiplications.

Growth rate, amplification, the smallest push and the creep of laws with two derivatives are read from the same steps.

**The smallest push.** Contacts from :math:`1 - 10^{-6}` of the bound on count as at the bound. The motion is the motion
to first order once the push goes `PUSH_OVER_RESIDUAL` times as far as the residual forces alone, and as what contacts
lack, which acts as a force on the particles as long as they slide: both motions are followed beside the pushes.

**Creep.** With mindlin_rescale and the standard law of this package the tangential force of a contact falls as it
parts, and does not rise as it closes. Vibration wears tangential forces down: each contact adds
:math:`B_c \int |\dot\delta_c| \mathrm dt` to the forces, and the packing moves on by :math:`K^{-1} B r`. With
dissipation the velocity of creep falls with the vibration, no more slowly than as :math:`e^{\mathrm{Re}\, s\, t}` with
the slowest s, so that a velocity v displaces particles by at most :math:`v / |\mathrm{Re}\, s|` more. Without it the
particles move on at a constant mean velocity.

`benchmarks/verdict_numbers.py` has 109 packings beside LAMMPS, and what each number decides.
"""

from collections.abc import Iterator
from itertools import islice
from types import SimpleNamespace

import numpy as np

from ..arrays import Floats
from ..configuration import Configuration
from ..fields_by_name import FieldsByName
from ..progress import report_progress
from .one_sided import CHUNK, LOOKS_PER_CHUNK, VERDICT_STEP, WORK_OF_MOTION, OneSidedSystem, follow, least_scale
from .rising_load import static_response

PUSHES = 2
"""Random pushes; the opposite of each is followed, too, since one-sided motion is not odd."""

GROWN_ENERGY = 1e10
"""Growth of the kinetic energy that no packing at rest was seen to reach without growing for ever: transients of
packings at Coulomb's bound went up to 6e5."""

STILL_SHARE = 1e-2
"""Slip that may be left, as a share of all slip: D then changes by 2 %."""

CREEP_CHUNKS = 32
"""Chunks for which creep is followed at the most; without dissipation an eighth of these."""

CREEP_LEFT = 0.1
"""Displacement by creep still to come, as a share of that so far, below which motion is not followed any longer."""


def random_pushes(configuration: Configuration, pushes: int) -> Floats:
    """Velocities of all coordinates, normal random numbers without rotations, and their opposites, shape (.., 2 P)."""
    rng = np.random.Generator(np.random.PCG64(0))
    push = np.zeros((configuration.coordinates, pushes))
    moving = configuration.dimension * len(configuration)
    push[:moving] = rng.standard_normal((moving, pushes))
    return np.hstack([push, -push])


def _followed(
    system: OneSidedSystem, pushes: int, chunks: int, time: float | None, beside: bool = False
) -> Iterator[SimpleNamespace]:
    """The motions after random pushes so far, chunk by chunk, up to the time or as many as may be."""
    usual, push = CHUNK * system.stable_step, random_pushes(system.configuration, pushes)
    entries = (system.motion.stiffness.nnz + system.motion.damping.nnz) * (2 * pushes + 2 * beside)
    most = int(np.clip(WORK_OF_MOTION / (entries * CHUNK / VERDICT_STEP), 4, chunks))
    if time is not None:  # whoever gives more time sees what a shorter run sees, too
        most = max(4, int(np.ceil(time / usual)))
        usual = time / most
    for seen in islice(follow(system, push, usual, beside=beside), most):
        largest = seen.size[-1, : 2 * pushes].max()
        report_progress(f"motion after pushes: t = {seen.time[-1]:.4g}, D = {largest:.3g} push^2")
        yield seen


def follow_pushes(
    system: OneSidedSystem, sticking: float, may_rest: bool, time: float | None = None, pushes: int = PUSHES
) -> FieldsByName:
    """Whether one-sided motion grows from some pushes: `Stability.one_sided`.

    `sticking` is the growth rate with sticking contacts, 1 / time, and `may_rest` whether these are not known to grow.
    The opposite of each push is followed, too, for the time, or until the motion has settled.

    Returns
    -------
    FieldsByName
        `grows`: True, False, or None if the motion has not settled. `growth_rate` of D, 1 / time, of the motion that
        grows, with its `error`, or with sticking contacts if it rests. `searched`: growth rate of D, 1 / time, below
        which growth may not have been seen; 0 where `grows` is known. `needed`: after which time it may be known, as D
        gains at its rate, or as the slowest vibration decays.

        `amplification` and `least_amplification`: largest D over the mean square velocity of the push along an axis,
        time^2, of all `pushes`, the opposite of each among them. `slip_left`: how much of their slip contacts may have
        still to come, as a share. `slides_on`: contacts that slide on at a constant velocity or faster, where the
        motion has not settled. `wears`: whether vibration wears contacts down, so that they may slide again. `time`:
        how long the motion was followed.

        `scales`: between which velocities of the push along an axis this holds for each of these pushes. Below,
        contacts that count as at the bound do not reach it, or the residual forces move the packing as well; above,
        other contacts reach the bound, open or close, or the force of one at the bound turns. The first is infinite if
        the residual forces alone do so. `changes_at`: where the motion grows, D at which the first contact changes.
    """
    grows, left, long_enough = None, np.inf, 1.99 * CHUNK * system.stable_step
    for seen in _followed(system, pushes, 120, time, beside=True):
        energy, size, first = (each[:, :-2] for each in (seen.energy, seen.size, seen.first))
        slid, end = seen.slid[:, :, :-2], float(seen.time[-1])
        if len(energy) < 2 * LOOKS_PER_CHUNK:
            continue
        if not np.all(energy[-1] <= GROWN_ENERGY * energy[0]):
            grows = True
        elif may_rest and end > long_enough and (now := _slip_left(slid)) <= STILL_SHARE:
            grows, left = False, now
        if grows or (time is None and grows is False):
            break
    (rate, error), needed, slides_on, at_growth = _rate(seen.time, energy), 0.0, 0, np.inf
    if grows is None:
        gained = float(np.log(energy[-1] / energy[0]).max())
        grown, rested = np.log(GROWN_ENERGY) - gained, 2 * np.log(STILL_SHARE)
        needed = float(end + grown / rate if rate > 0 else rested / sticking if sticking else 0.0)
        quarters = [2 * len(slid) // 4, 3 * len(slid) // 4, -1]
        before, after = np.diff(slid[quarters], axis=0) + np.finfo(float).tiny
        goes_on = (0.9 * before < after) & (after < 1.5 * before)  # faster, it may grow
        slides_on = int(goes_on.any(axis=1).sum()) if end > long_enough else 0
    elif grows:
        at_growth = float((first[-LOOKS_PER_CHUNK:] ** 2 * seen.size_at_first[-LOOKS_PER_CHUNK:, :-2]).min())
    return FieldsByName(
        grows=grows, growth_rate=rate if grows else (sticking if grows is False else None),
        error=error if grows else None, searched=float(np.log(GROWN_ENERGY) / end) if grows is None else 0.0,
        needed=needed if end < needed < np.inf else None, amplification=float(size.max()),
        least_amplification=float(size.max(axis=0).min()),
        slip_left=left if grows is False and np.isfinite(left) else None, slides_on=slides_on,
        wears=bool(seen.paths.shape[1]), time=end, pushes=size.shape[1],
        scales=(least_scale(seen), float(first.min())), changes_at=at_growth if np.isfinite(at_growth) else None,
    )  # fmt: skip


def _slip_left(slid: Floats) -> float:
    """Slip still to come as a share of all slip, the largest of the pushes, by p at equal times, shape (L, B, P);
    infinite if not known.

    Slips of all contacts in the last three of four quarters of the time fall by at most a ratio, and go on to.
    """
    count = len(slid)
    whole = slid[[0, count // 4, count // 2, 3 * count // 4, -1]].sum(axis=1)
    steps, small = np.diff(whole, axis=0)[1:], np.finfo(float).eps * slid.shape[1] * whole[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.max(np.where(steps[1:] <= small, 0.0, steps[1:] / steps[:-1]), axis=0)
        left = np.where(ratio < 1, steps[-1] * ratio / (1 - ratio), np.inf)
        left = np.where(steps[-1] <= small, 0.0, left) / whole[-1]
    return float(np.nan_to_num(left, nan=0.0, posinf=np.inf).max())


def _rate(times: Floats, energy: Floats) -> tuple[float, float]:
    """Growth rate of the energy over the second half of the time, and its error: what its two quarters differ by, and
    that of the steps."""
    with np.errstate(divide="ignore"):
        logs = np.log(energy[:, int(np.argmax(energy[-1]))])
    half, three = len(times) // 2, 3 * len(times) // 4
    slopes = [np.polyfit(times[a:b], logs[a:b], 1)[0] for a, b in ((half, three), (three, None))]
    mean = float(np.mean(slopes))
    return mean, float(np.hypot(abs(slopes[1] - slopes[0]) / 2, 0.03 * mean))


def follow_creep(
    system: OneSidedSystem, pushes: int = PUSHES, time: float | None = None, decay: float = 0.0, free: int = 0
) -> FieldsByName:
    """How far vibration carries particles whose contacts have two derivatives: `Stability.creep`.

    Random pushes and their opposites are followed until little is left to come, or for some time. `decay` is -Re s of
    the slowest motion, 1 / time, 0 if that is not known or nothing decays; `free` motions no force opposes.

    Returns
    -------
    FieldsByName
        `amplification`: largest D of this displacement over the mean square velocity of the push along an axis, time^2,
        within the `time` that motion was followed. `velocity` and `least_velocity`: root mean square over the particles
        of its mean velocity in the last quarter of this time, over that of the push. `limit`: `amplification` that
        vibration may reach later, while the slowest motion decays; None if that is not known, as without dissipation.
        `settled`: whether little is left to come. `grows`: whether the motion grew, in spite of linear motion that does
        not, and its `growth_rate`; None if its energy has risen, and less.
    """
    for seen in _followed(system, pushes, CREEP_CHUNKS if decay else CREEP_CHUNKS // 8, time):
        count = len(seen.time)
        if count < 4 * LOOKS_PER_CHUNK:
            continue
        quarter = 3 * count // 4 - 1
        paths = np.hstack([seen.paths[quarter], seen.paths[-1]])  # the paths that overlaps have gone
        early, late = np.split(static_response(system.motion, system.wear @ paths, free), 2, axis=1)
        sizes, end = system.mean_square_displacement(late), float(seen.time[-1])
        velocity = np.sqrt(system.mean_square_displacement(late - early)) / (end - seen.time[quarter])
        limit = float(((np.sqrt(sizes) + velocity / decay) ** 2).max()) if decay > 0 else None
        settled = limit is not None and limit <= (1 + CREEP_LEFT) ** 2 * float(sizes.max())
        gained = float(np.max(seen.energy[-1] / seen.energy[0]))
        # the energy of a push is all kinetic at first, and half of it later
        grows = True if not gained <= GROWN_ENERGY else None if gained > 2 else False
        if grows or (settled and time is None):
            break
    return FieldsByName(
        amplification=float(sizes.max()), time=end, velocity=float(velocity.max()),
        least_velocity=float(velocity.min()), limit=limit, settled=settled, grows=grows,
        growth_rate=_rate(seen.time, seen.energy)[0] if grows else 0.0,
    )  # fmt: skip
