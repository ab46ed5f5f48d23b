"""Simulations turned into a function: any parameters, any amplitudes of effects, at no cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError
from pipeline.gap.candidate import Candidate
from pipeline.gap.effect import MeasurementEffect
from pipeline.gap.effects import effect
from pipeline.gap.modes import modal
from pipeline.gap.observation import Reading, Sight
from pipeline.gap.response import Abscissae, Response, continued, read, split
from pipeline.inverse.surrogate import LagrangeSurrogate

MARGIN = 0.1  # of the grid's width, by which parameters may leave it
RASTER = 0.08  # of the logarithm of parameters: signatures are simulated at places so far apart
LARGE = 0.2  # of the larger value that a signature was simulated at
SHIFTS = (0.85, 1.0, 1.15)  # of the stations: data that a shift along the CMOD would lose are left out for all alike


@dataclass(frozen=True, eq=False)
class Signature:
    """What a physics effect changes: a parabola through none and two simulated values.

    Parameters
    ----------
    values : (2,) array; at which it was simulated
    changes : (2, n) array; of `Response.flat`, against the simulation without it at the same parameters
    """

    values: np.ndarray
    changes: np.ndarray

    def at(self, value: float) -> np.ndarray:
        """Change (n,) by another value (Lagrange's polynomial with the third node at none)."""
        one, two = self.values
        weight = np.array([value * (value - two) / (one * (one - two)), value * (value - one) / (two * (two - one))])
        return weight @ self.changes

    @property
    def slope(self) -> np.ndarray:
        """Change (n,) for a value of one, of the straight line nearest to the two."""
        return np.asarray(self.values @ self.changes / (self.values @ self.values))

    def doubt(self, value: float) -> np.ndarray:
        """How far (n,) the change by another value may be off: as far, in proportion, as two are from the line.

        Two values cannot tell a curve from a crack that goes another way in one of the simulations.
        """
        one, two = self.changes / self.values[:, None]
        curvature = (two - one) / (self.values[1] - self.values[0])
        middle = np.sum(self.values**3) / np.sum(self.values**2)
        return np.asarray(value * np.sqrt(np.mean((self.values - middle) ** 2)) * curvature)

    def large(self, value: float) -> bool:
        """Whether an error at this value says something of others: in proportion, that of a tiny one is all scatter."""
        return bool(abs(value) >= LARGE * np.abs(self.values).max())

    def corrected(self, value: float, error: np.ndarray) -> Signature:
        """With a change that grows in proportion to the value, which is `large`, and is `error` (n,) at this one."""
        return replace(self, changes=self.changes + np.outer(self.values / value, error))


@dataclass(frozen=True, eq=False)
class Emulator:
    """Data of a test as a function of (f_max, δ_max) and of effects.

    Parameters
    ----------
    sight : Sight
    abscissae : Abscissae
    f_max, delta_max : (n_f,), (n_d,) arrays, N and m; the grid
    values : (n_f, n_d, n) array of `Response.flat`
    signatures : effect → Signature, physics effects only
    offset : (n,) array; added to everything, so that a confirmed point is met exactly
    again : (parameters (2,), `Response.flat` (n,)) of simulations beside a confirmed point, which the function is not
        drawn through: what they differ by from it is scatter
    placed : (n,) arrays; changes of `Response.flat` when the lattice lies elsewhere on the specimen: what is read is
        the mean of all places
    clear : (p,) bool; points that tell what effects do to the flanks, None: all
    """

    sight: Sight
    abscissae: Abscissae
    f_max: np.ndarray
    delta_max: np.ndarray
    values: np.ndarray
    signatures: Mapping[str, Signature] = field(default_factory=dict)
    offset: np.ndarray | float = 0.0
    again: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    placed: tuple[np.ndarray, ...] = ()
    clear: np.ndarray | None = None

    @cached_property
    def _known(self) -> np.ndarray:
        """Numbers that every simulation has; (n,) bool."""
        known = np.isfinite(self.values).all(axis=(0, 1))
        for signature in self.signatures.values():
            known &= np.isfinite(signature.changes).all(axis=0)
        for change in self.placed:
            known &= np.isfinite(change)
        return known & np.isfinite(self.offset)

    @cached_property
    def _surrogate(self) -> LagrangeSurrogate:
        return LagrangeSurrogate(self.f_max, self.delta_max, self._continued(self.values))

    @cached_property
    def _smooth(self) -> tuple[Mapping[str, Signature], np.ndarray]:
        """Signatures, of the modes only, and offset without gaps.

        What an effect changes beside the modes depends on which bonds hold which particle: no other model has it.
        """
        whole = {n: replace(s, changes=self._modal(s.changes)) for n, s in self.signatures.items()}
        return whole, self._continued(np.broadcast_to(self.offset, self.values.shape[-1:]))

    def _modal(self, changes: np.ndarray) -> np.ndarray:
        """Changes (2, n) of whole responses without gaps, and with no more than modes in their fields."""
        found = []
        for gappy, whole in zip(changes, self._continued(changes), strict=True):
            parts = [split(row, self.abscissae, len(self.sight.points)) for row in (gappy, whole)]
            use = np.isfinite(parts[0].field.sum(axis=2))
            if self.clear is not None:
                use &= self.clear
            found.append(np.concatenate([modal(self.sight, use, parts[1].field).ravel(), parts[1].load]))
        return np.array(found)

    def _continued(self, flat: np.ndarray) -> np.ndarray:
        """Numbers (..., n) whose gaps are bridged; they are never compared, see `available`."""
        rows = np.reshape(flat, (-1, flat.shape[-1]))
        points = len(self.sight.points)
        parts = [split(row, self.abscissae, points) for row in rows]
        return np.reshape([Response(continued(p.field), continued(p.load)).flat() for p in parts], flat.shape)

    @cached_property
    def _usual(self) -> np.ndarray:
        return self.abscissae.frames_to(self.sight.cmod)

    @cached_property
    def _shift(self) -> np.ndarray:
        """From the lattice where it lies to the mean of all places; (n,)."""
        rows = self._continued(np.reshape(self.placed, (len(self.placed), self.values.shape[-1])))
        return np.asarray(rows.sum(axis=0) / (len(self.placed) + 1))

    @property
    def box(self) -> np.ndarray:
        """Bounds of the parameters; (2, 2)."""
        lines = (self.f_max, self.delta_max)
        return np.array([(x[0] - MARGIN * np.ptp(x), x[-1] + MARGIN * np.ptp(x)) for x in lines])

    @property
    def inner(self) -> np.ndarray:
        """Bounds in the middle of the outermost cells of the grid; (2, 2)."""
        return np.array([((x[0] + x[1]) / 2, (x[-2] + x[-1]) / 2) for x in (self.f_max, self.delta_max)])

    def rounded(self, parameters: np.ndarray) -> np.ndarray:
        """Parameters (2,) at the nearest of so few places that tests of one specimen share what is simulated there."""
        return np.exp(RASTER * np.rint(np.log(parameters) / RASTER))

    def response(self, parameters: np.ndarray, physics: Mapping[str, float]) -> Response:
        """What one simulation would say, the lattice lying where it lies."""
        signatures, offset = self._smooth
        flat = self._surrogate.value(parameters) + offset
        for name, value in physics.items():
            flat += signatures[name].at(value)
        return split(flat, self.abscissae, len(self.sight.points))

    def reading(
        self, parameters: np.ndarray, names: Sequence[str] = (), amplitudes: np.ndarray | None = None
    ) -> Reading:
        """What camera and load cell would say, effects acting in the order of their names.

        Parameters
        ----------
        parameters : (2,) array, N and m
        names : effects
        amplitudes : (k,) array; of the effects in the order given, one a direction
        """
        measuring, physics = self._sorted(names, np.zeros(0) if amplitudes is None else amplitudes)
        field_at = load_at = self.sight.cmod
        for one, value in measuring:
            field_at, load_at = one.field_at(value, self.sight, field_at), one.load_at(value, self.sight, load_at)
        if field_at is self.sight.cmod and load_at is self.sight.cmod:
            found = self._at_stations(parameters, physics)
        else:
            flat = self.response(parameters, physics).flat() + self._shift
            simulated = split(flat, self.abscissae, len(self.sight.points))
            weights = self.abscissae.frames_to(field_at)
            rows = weights @ simulated.field.reshape(len(simulated.field), -1)
            field = rows.reshape(-1, *simulated.field.shape[1:])
            found = Reading(field, self.abscissae.loads_to(simulated.load, load_at))
        for one, value in measuring:
            found = one.distort(value, self.sight, found)
        return found

    @cached_property
    def _read(self) -> tuple[LagrangeSurrogate, Mapping[str, Signature], np.ndarray]:
        """Grid, signatures and what is added at the usual stations: all is linear in what is simulated."""
        signatures, offset = self._smooth
        values = self._surrogate.values
        grid = self._at_usual(values.reshape(-1, values.shape[-1])).reshape(*values.shape[:2], -1)
        there = {n: replace(s, changes=self._at_usual(s.changes)) for n, s in signatures.items()}
        added = self._at_usual((offset + self._shift)[None])[0]
        return LagrangeSurrogate(self.f_max, self.delta_max, grid), there, added

    def _at_usual(self, rows: np.ndarray) -> np.ndarray:
        """Numbers (j, n) of whole responses as `Reading.flat` (j, 2sp + s) at the usual stations."""
        look, points, found = self.abscissae, len(self.sight.points), []
        for row in rows:
            one = split(row, look, points)
            field = self._usual @ one.field.reshape(len(one.field), -1)
            found.append(np.concatenate([field.ravel(), look.loads_to(one.load, self.sight.cmod)]))
        return np.array(found)

    def _at_stations(self, parameters: np.ndarray, physics: Mapping[str, float]) -> Reading:
        grid, signatures, offset = self._read
        flat = grid.value(parameters) + offset
        for name, value in physics.items():
            flat += signatures[name].at(value)
        s, p = self.sight.cmod.size, len(self.sight.points)
        return Reading(flat[: 2 * s * p].reshape(s, p, 2), flat[2 * s * p :])

    def _sorted(
        self, names: Sequence[str], amplitudes: np.ndarray
    ) -> tuple[list[tuple[MeasurementEffect, np.ndarray]], dict[str, float]]:
        at, measuring, physics = 0, {}, {}
        for name in names:
            one = effect(name)
            part = amplitudes[at : at + one.magnitude.directions]
            at += one.magnitude.directions
            if isinstance(one, MeasurementEffect):
                measuring[name] = (one, part)
            else:
                physics[name] = float(part[0])
        return [measuring[name] for name in sorted(measuring)], physics

    def available(self) -> np.ndarray:
        """Which numbers of `Reading.flat` every candidate can predict; (2sp + s,) bool."""
        known = split(self._known, self.abscissae, len(self.sight.points))
        frames, cmod, look = known.field.sum(axis=2) == 2, self.sight.cmod, self.abscissae
        field = np.all([look.known_at(frames, s * cmod) for s in SHIFTS], axis=0)
        load = np.all([look.reached(known.load, s * cmod) for s in SHIFTS], axis=0)
        return np.concatenate([np.repeat(field.ravel(), 2), load])

    def candidate(self, names: Sequence[str], mask: np.ndarray) -> Candidate:
        """The explanation by some effects; none without names.

        Parameters
        ----------
        names : effects; physics effects among them need a signature
        mask : (2sp + s,) bool; the data
        """
        lacking = [n for n in names if not isinstance(effect(n), MeasurementEffect) and n not in self.signatures]
        if lacking:
            raise InputError(f"{', '.join(lacking)} was not simulated: there is no signature to judge it by")
        chosen = tuple(names)
        return Candidate(
            chosen,
            tuple(effect(n).magnitude for n in chosen),
            lambda parameters, amplitudes: self.reading(parameters, chosen, amplitudes).flat()[mask],
            lambda amplitudes: self._doubt(chosen, amplitudes)[:, mask].T,
        )

    def _doubt(self, names: Sequence[str], amplitudes: np.ndarray) -> np.ndarray:
        """By what the changes by the physics effects among some are uncertain; (j, 2sp + s)."""
        _, physics = self._sorted(names, amplitudes)
        signatures = self._read[1]
        rows = [signatures[name].doubt(value) for name, value in physics.items()]
        return np.reshape(rows, (len(rows), 2 * self.sight.cmod.size * len(self.sight.points) + self.sight.cmod.size))

    def unloaded(self) -> Emulator:
        """The same, told nothing of the measured load."""
        return replace(self, sight=replace(self.sight, load=np.zeros(0)))

    def confirmed(self, parameters: np.ndarray, simulated: np.ndarray) -> Emulator:
        """Moved by what a simulation without effects at these parameters, `Response.flat` (n,), says otherwise."""
        return replace(self, offset=self.offset + simulated - self.response(parameters, {}).flat())

    def elsewhere(self, mask: np.ndarray) -> np.ndarray:
        """What the places of the lattice differ by from their mean; (places, n) of the data, zero of a single place."""
        points, cmod = len(self.sight.points), self.sight.cmod
        rows = [read(split(p, self.abscissae, points), self.abscissae, cmod, cmod).flat()[mask] for p in self.placed]
        changes = np.nan_to_num(np.reshape([np.zeros(int(mask.sum())), *rows], (-1, int(mask.sum()))))
        return changes - changes.mean(axis=0)

    def slopes(self, mask: np.ndarray) -> dict[str, np.ndarray]:
        """What physics effects change of the data (n,) for a value of one, as far as it grows in proportion."""
        return {name: signature.slope[mask] for name, signature in self._read[1].items()}

    def jitter(self, mask: np.ndarray) -> np.ndarray:
        """What the simulations beside a confirmed point differ by from the function; (j, n) of the data."""
        bare = replace(self, signatures={})  # of which none is read here
        rows = [bare.confirmed(at, flat).reading(at) - bare.reading(at) for at, flat in self.again]
        return np.array([row.flat()[mask] for row in rows]).reshape(len(rows), int(mask.sum()))

    def with_confirmed(self, name: str, value: float, parameters: np.ndarray, simulated: np.ndarray) -> Emulator:
        """The same for an effect: its signature then meets the simulation of this value at these parameters."""
        error = simulated - self.response(parameters, {name: value}).flat()
        changed = dict(self.signatures) | {name: self.signatures[name].corrected(value, error)}
        return replace(self, signatures=changed)
