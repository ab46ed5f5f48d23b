"""What is compared with the measurement: displacements of material points at the CMOD stations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.interpolation import plane_weights
from pipeline.core.particles import Bonds, Particles


def stations(curve: LoadCurve, count: int, step: float) -> np.ndarray:
    """CMOD stations of a measured curve: the first at its peak, the others in equal steps behind it.

    The peak is that of the parabola through the flat top. Stations may lie beyond the record; the
    objective leaves those out and counts them (Hill et al. 2017, "Hybrid DIC-DEM").

    Parameters
    ----------
    curve : LoadCurve, measured
    count : int, at least 1
    step : float, m, positive

    Returns
    -------
    (count,) array, m
    """
    if count < 1 or not step > 0:
        raise InputError(f"{count} stations in steps of {step:g} m: at least one and a positive step are needed")
    return curve.peak()[0] + step * np.arange(count)


def observe(
    particles: Particles,
    bonds: Bonds,
    displacement: np.ndarray,
    points: np.ndarray,
    open_at: np.ndarray,
    reach: float | None = None,
    joined_as_in: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of material points, each from the particles still joined on its own crack flank.

    In every frame the bonds whose length has changed by more than `open_at` are cut: lengthened across an
    open crack, or shortened where its faces have slid (no whole bond is compressed that far). Of the
    particles within `reach` of a point those that hang together with the nearest one are kept, and the
    plane of `core.interpolation.plane_weights` is laid through them: exact for affine motion of each flank.

    Parameters
    ----------
    particles : Particles, n of them
    bonds : Bonds, m of them; there is none across the notch
    displacement : (frames, n, 2) array, m
    points : (p, 2) array, m; reference positions
    open_at : (m,) array, m; change of length from which a bond no longer joins, a fraction of its delta_max
    reach : float, m; three particle spacings where not given
    joined_as_in : (frames, n, 2) array, m; fields that tell which bonds are cut, `displacement` where not given

    Returns
    -------
    values : (frames, p, 2) array, m; NaN where invalid
    valid : (frames, p) bool array; False where the nearest particle is farther than half the reach (a
        void, or outside), and where too few joined particles are left to carry a plane without
        magnifying their scatter (Σw² > 1)
    """
    reach = 6 * particles.radius if reach is None else reach
    near = _neighbourhoods(particles, bonds, np.asarray(points, float), reach)
    values = np.full((len(displacement), len(points), 2), np.nan)
    joined, weight, carried = None, np.zeros(near.index.shape), np.zeros(len(points), bool)
    telling = displacement if joined_as_in is None else joined_as_in
    for frame, field, parting in zip(values, displacement, telling, strict=True):
        whole = np.abs(_elongation(particles.position, near.pairs, parting)) <= open_at[near.used]
        before, joined = joined, _joined(near, whole)
        changed = np.ones(len(points), bool) if before is None else np.any(joined != before, axis=1)
        for point in np.flatnonzero(changed).tolist():
            weight[point], carried[point] = _weights(near, point, joined[point])
        frame[carried] = np.einsum("pk,pkx->px", weight, field[near.index])[carried]
    return values, np.isfinite(values[:, :, 0])


@dataclass(frozen=True)
class _Neighbourhoods:
    """Particles around p points, filled up to the same number k, and the d bonds each has among them.

    index (p, k) particles; arm (p, k, 2) m, point to particle; first (p, k), the nearest particle, none in
    a void; used (b,) numbers and pairs (b, 2) particles of all bonds near points; partner (p, k, d) place of
    the other particle among the k; bond (p, k, d) place among the used bonds, b where there is none.
    """

    index: np.ndarray
    arm: np.ndarray
    first: np.ndarray
    used: np.ndarray
    pairs: np.ndarray
    partner: np.ndarray
    bond: np.ndarray
    reach: float


def _neighbourhoods(particles: Particles, bonds: Bonds, points: np.ndarray, reach: float) -> _Neighbourhoods:
    owner, member = _within(particles.position, points, reach)
    size = np.bincount(owner, minlength=len(points))
    place = np.arange(owner.size) - np.repeat(np.cumsum(size) - size, size)
    shape = (len(points), max(int(size.max(initial=0)), 1))
    index, inside = np.zeros(shape, int), np.zeros(shape, bool)
    index[owner, place], inside[owner, place] = member, True
    arm = particles.position[index] - points[:, None]
    distance = np.where(inside, np.hypot(arm[..., 0], arm[..., 1]), np.inf)
    first = (np.arange(shape[1]) == np.argmin(distance, axis=1)[:, None]) & (distance <= reach / 2)
    touched = np.zeros(particles.count, bool)
    touched[member] = True
    used = np.flatnonzero(np.all(touched[bonds.pairs], axis=1))
    pairs = bonds.pairs[used].astype(int)
    other, bond = _bonds_of_particles(pairs, particles.count)
    partner, bond = _local(owner, member, place, other, bond, (*shape, other.shape[1]))
    return _Neighbourhoods(index, arm, first, used, pairs, partner, np.where(partner < 0, used.size, bond), reach)


def _within(position: np.ndarray, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (point, particle) not farther apart than `reach`, sorted by point, then particle."""
    origin = np.minimum(position.min(axis=0), points.min(axis=0, initial=np.inf)) - reach
    highest = np.maximum(position.max(axis=0), points.max(axis=0, initial=-np.inf))
    columns = int((highest[0] - origin[0]) / reach) + 3
    cell = _cell(position, origin, reach, columns)
    order = np.argsort(cell, kind="stable")
    shift = np.array([i + columns * j for j in (-1, 0, 1) for i in (-1, 0, 1)])
    wanted = _cell(points, origin, reach, columns)[:, None] + shift
    start, stop = np.searchsorted(cell[order], wanted, "left"), np.searchsorted(cell[order], wanted, "right")
    count = (stop - start).ravel()
    owner = np.repeat(np.repeat(np.arange(len(points)), shift.size), count)
    offset = np.arange(owner.size) - np.repeat(np.cumsum(count) - count, count)
    member = order[np.repeat(start.ravel(), count) + offset]
    close = np.sum((position[member] - points[owner]) ** 2, axis=1) <= reach**2
    owner, member = owner[close], member[close]
    by_point = np.lexsort((member, owner))
    return owner[by_point], member[by_point]


def _cell(at: np.ndarray, origin: np.ndarray, size: float, columns: int) -> np.ndarray:
    """Number of the square cell in which each point lies."""
    column, row = np.floor((at - origin) / size).astype(int).T
    return column + columns * row


def _bonds_of_particles(pairs: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The other particle and the number of each bond of each particle, both (n, d), −1 where there is none."""
    one, two = pairs.T
    particle, other = np.concatenate([one, two]), np.concatenate([two, one])
    order = np.argsort(particle, kind="stable")
    size = np.bincount(particle, minlength=count)
    place = np.arange(particle.size) - np.repeat(np.cumsum(size) - size, size)
    table = np.full((2, count, max(int(size.max(initial=0)), 1)), -1)
    table[0, particle[order], place] = other[order]
    table[1, particle[order], place] = order % max(len(pairs), 1)
    return table[0], table[1]


def _local(
    owner: np.ndarray, member: np.ndarray, place: np.ndarray, other: np.ndarray, bond: np.ndarray, shape: tuple
) -> tuple[np.ndarray, np.ndarray]:
    """Place among a point's particles of the other end of each bond, −1 where it is out of reach; and the bond."""
    partner, number = np.full(shape, -1), np.full(shape, -1)
    if owner.size:
        key, wanted = owner * len(other) + member, owner[:, None] * len(other) + other[member]
        found = np.minimum(np.searchsorted(key, wanted), key.size - 1)
        exists = (other[member] >= 0) & (key[found] == wanted)
        partner[owner, place] = np.where(exists, place[found], -1)
        number[owner, place] = bond[member]
    return partner, number


def _elongation(position: np.ndarray, pairs: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Lengthening of each bond (b,), m; rotation of the whole leaves it zero."""
    one, two = pairs.T
    vector = position[two] - position[one]
    now = vector + field[two] - field[one]
    return np.hypot(now[:, 0], now[:, 1]) - np.hypot(vector[:, 0], vector[:, 1])


def _joined(near: _Neighbourhoods, whole: np.ndarray) -> np.ndarray:
    """Particles that hang together with the nearest one through whole bonds within reach; (p, k) bool."""
    passable = np.append(whole, False)[near.bond]
    rows = np.arange(len(near.index))[:, None, None]
    joined, active = near.first.copy(), np.arange(len(near.index))
    while active.size:
        now = joined[active]
        grown = now | np.any(passable[active] & now[rows[: active.size], near.partner[active]], axis=2)
        joined[active] = grown
        active = active[np.any(grown != now, axis=1)]
    return joined


def _weights(near: _Neighbourhoods, point: int, joined: np.ndarray) -> tuple[np.ndarray, bool]:
    """Weights (k,) of the particles around one point, and whether they carry it."""
    weight = np.zeros(joined.size)
    try:
        weight[joined] = plane_weights(near.arm[point, joined], np.zeros(2), near.reach)
    except InputError:
        return weight, False
    return weight, bool(weight @ weight <= 1)
