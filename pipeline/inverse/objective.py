"""The difference between measured and simulated tests (Hill et al. 2017, eq. 5), and what it is taken over."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.field import rigid_motion
from pipeline.inverse.flanks import changed_flank
from pipeline.inverse.observations import Measured, Simulated


class Objective(StrEnum):
    """What is compared."""

    FIELDS = "fields"  # Σ‖u − û‖², m²: the paper
    LOAD = "load"  # Σ((P − P̂)/σ_P)²
    BOTH = "both"  # the two, each divided by its noise


class Rigid(StrEnum):
    """What becomes of rigid motion in the residual of each station."""

    FIT = "fit"  # least-squares translation and rotation over all points are taken out
    KEEP = "keep"  # the paper


@dataclass(frozen=True)
class Comparison:
    """The data that measurement and *all* simulations have, and how a difference is weighed.

    A station or point that is missing anywhere is left out everywhere: otherwise nodes of the grid would
    be judged by different data and Φ would jump between them.

    Parameters
    ----------
    objective : Objective
    rigid : Rigid
    measured : Measured
    use_field : (s, p) bool array
    use_load : (s,) bool array
    """

    objective: Objective
    rigid: Rigid
    measured: Measured
    use_field: np.ndarray
    use_load: np.ndarray

    @cached_property
    def field_scale(self) -> float:
        """Field differences are divided by this (m): 1 for `fields`, the rms noise for `both`."""
        if self.objective is not Objective.BOTH:
            return 1.0
        assert self.measured.field is not None
        return float(np.sqrt(np.mean(self.measured.field.std[self.use_field] ** 2)))

    @property
    def field_size(self) -> int:
        """Number of displacement components in a feature vector; the loads follow them."""
        return 2 * int(self.use_field.sum())

    @property
    def size(self) -> int:
        """Number N of data."""
        return self.field_size + int(self.use_load.sum())

    def features(self, displacement: np.ndarray | None, load: np.ndarray | None) -> np.ndarray:
        """What Φ is the squared length of, for data or differences of data: linear in them; (..., N).

        Parameters
        ----------
        displacement : (..., s, p, 2) array, m
        load : (..., s) array, N
        """
        parts = []
        if self.use_field.any():
            assert displacement is not None
            field = self._without_rigid(displacement)[..., self.use_field, :] / self.field_scale
            parts.append(field.reshape(*field.shape[:-2], -1))
        if self.use_load.any():
            assert load is not None
            assert self.measured.load_std is not None
            parts.append((load / self.measured.load_std)[..., self.use_load])
        return np.concatenate(parts, axis=-1)

    @cached_property
    def target(self) -> np.ndarray:
        """The measurement's features; (N,)."""
        return self.features(
            None if self.measured.field is None else self.measured.field.displacement, self.measured.load
        )

    @cached_property
    def noise(self) -> np.ndarray:
        """Variance of the measuring noise of each datum, before rigid motion is taken out, in feature units; (N,)."""
        parts = []
        if self.use_field.any():
            assert self.measured.field is not None
            parts.append(np.repeat((self.measured.field.std[self.use_field] / self.field_scale) ** 2, 2))
        parts.append(np.ones(int(self.use_load.sum())))
        return np.concatenate(parts)

    @cached_property
    def leverage(self) -> np.ndarray:
        """Share of each datum's white noise that leaves with the rigid motion; (N,)."""
        taken = np.zeros((*self.use_field.shape, 2))
        if self.rigid is Rigid.FIT and self.use_field.any():
            assert self.measured.field is not None
            for one, use in zip(taken, self.use_field, strict=True):
                if use.any():
                    arm = self.measured.field.points - self.measured.field.points[use].mean(axis=0)
                    one[:] = 1 / use.sum() + arm[:, ::-1] ** 2 / np.sum(arm[use] ** 2)
        return np.concatenate([taken[self.use_field].ravel(), np.zeros(int(self.use_load.sum()))])

    def _without_rigid(self, displacement: np.ndarray) -> np.ndarray:
        known = np.where(self.use_field[..., None], displacement, 0.0)
        if self.rigid is Rigid.KEEP:
            return known
        assert self.measured.field is not None
        for station, use in enumerate(self.use_field):
            if use.any():
                known[..., station, :, :] -= rigid_motion(self.measured.field.points, known[..., station, :, :], use)
        return known


def compare(measured: Measured, simulated: Simulated, objective: Objective, rigid: Rigid) -> Comparison:
    """Find the data that the measurement and all simulations have.

    With rigid = fit a station needs three points, as translation and rotation alone explain less.

    Raises
    ------
    InputError
        if the objective asks for data that were not measured or simulated, or fewer than three are left
    """
    use_field, use_load = np.zeros((len(measured.cmod), 0), bool), np.zeros(len(measured.cmod), bool)
    if objective is not Objective.LOAD:
        use_field = _common_field(measured, simulated)
        if rigid is Rigid.FIT:
            use_field = use_field & (use_field.sum(axis=1) >= 3)[:, None]
    if objective is not Objective.FIELDS:
        use_load = _common_load(measured, simulated)
    found = Comparison(objective, rigid, measured, use_field, use_load)
    _enough(found)
    if objective is Objective.BOTH and not found.field_scale > 0:
        raise InputError(
            "objective = both divides displacements by their noise, but std_mm is zero: state the noise in [noise] "
            "displacement_std_mm or in the fields, or compare fields or load alone"
        )
    return found


def differences(comparison: Comparison, simulated: Simulated) -> tuple[np.ndarray, np.ndarray]:
    """Φ at every node (n_f, n_d), eq. (5), and the simulations' features (n_f, n_d, N)."""
    features = comparison.features(simulated.displacement, simulated.load)
    return np.sum((features - comparison.target) ** 2, axis=-1), features


def left_out(comparison: Comparison) -> tuple[str, ...]:
    """What the comparison does without, in sentences; empty where nothing is missing."""
    found = []
    stations, points = comparison.use_field.shape
    if points:
        missing = comparison.use_field.size - int(comparison.use_field.sum())
        whole = stations - int(comparison.use_field.any(axis=1).sum())
        if missing:
            found.append(
                f"{missing} of {comparison.use_field.size} displacement vectors are missing in the measurement or in a "
                "simulation, or lie on another side of the crack there, and are left out of all "
                f"({whole} of {stations} stations wholly)."
            )
    if comparison.objective is not Objective.FIELDS:
        missing = comparison.use_load.size - int(comparison.use_load.sum())
        if missing:
            found.append(
                f"{missing} of {stations} loads are missing in the measurement or in a simulation and are left out."
            )
    return tuple(found)


def _common_field(measured: Measured, simulated: Simulated) -> np.ndarray:
    if measured.field is None or simulated.displacement is None:
        raise InputError("this objective compares displacement fields, but none were given: use objective = load")
    shape = measured.field.valid.shape
    if simulated.displacement.shape[2:] != (*shape, 2):
        raise InputError(f"simulated fields have shape {simulated.displacement.shape[2:]}, measured ones {(*shape, 2)}")
    field = measured.field
    measured_ok = field.valid & np.isfinite(field.displacement).all(axis=-1)
    seen = np.where(measured_ok[..., None], field.displacement, np.nan)
    other = changed_flank(field.points, seen, field.std, simulated.displacement)
    return measured_ok & ~other & np.isfinite(simulated.displacement).all(axis=(0, 1, 4))


def _common_load(measured: Measured, simulated: Simulated) -> np.ndarray:
    if measured.load is None or simulated.load is None:
        raise InputError("this objective compares loads, but none were given: use objective = fields")
    if simulated.load.shape[2:] != measured.load.shape:
        raise InputError(f"simulated loads have shape {simulated.load.shape[2:]}, measured ones {measured.load.shape}")
    return np.isfinite(measured.load) & np.isfinite(simulated.load).all(axis=(0, 1))


def _enough(comparison: Comparison) -> None:
    poor = comparison.objective is not Objective.LOAD and not comparison.use_field.any()
    poor |= comparison.objective is not Objective.FIELDS and not comparison.use_load.any()
    if poor or comparison.size < 3:
        raise InputError(
            f"only {comparison.use_field.sum()} displacement vectors and {comparison.use_load.sum()} loads are in the "
            "measurement and in every simulation, too few for two parameters: check that the CMOD ranges overlap and "
            "that the observation points lie in the material"
        )
