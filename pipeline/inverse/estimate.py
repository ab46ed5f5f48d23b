"""From a grid of simulations and a measurement to fracture parameters: no files, no engine."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from pipeline.core.errors import InputError
from pipeline.inverse.design import Design
from pipeline.inverse.discrepancy import Discrepancy
from pipeline.inverse.newton import Minimum, minimise
from pipeline.inverse.objective import Comparison, Objective, Rigid, compare, differences, left_out
from pipeline.inverse.observations import Measured, Simulated
from pipeline.inverse.placements import Placements
from pipeline.inverse.radial import radial_minimum
from pipeline.inverse.resolution import data_minimum, resolves
from pipeline.inverse.squares import SquaredDifference
from pipeline.inverse.surrogate import LagrangeSurrogate, leave_one_out
from pipeline.inverse.uncertainty import Fit, Uncertainty, curvature_certainty, uncertainty


class Surrogate(StrEnum):
    """What the multinomials run through."""

    OBJECTIVE = "objective"  # Φ at the nodes: the paper
    DATA = "data"  # the simulated data at the nodes, squared afterwards


CERTAIN = 3.0  # curvature over its scatter; below it a warning is given


@dataclass(frozen=True)
class Settings:
    """How an estimate is made.

    Parameters
    ----------
    objective : Objective
    modulus_std : float, relative; standard deviation of the modulus the simulations assume
    rigid : Rigid
    discrepancy : Discrepancy
    confidence : float, between 0 and 1
    surrogate : Surrogate
    """

    objective: Objective
    modulus_std: float
    rigid: Rigid = Rigid.FIT
    discrepancy: Discrepancy = field(default_factory=Discrepancy)
    confidence: float = 0.95
    surrogate: Surrogate = Surrogate.OBJECTIVE

    def __post_init__(self) -> None:
        if not 0 < self.confidence < 1:
            raise InputError(f"confidence = {self.confidence} must lie between 0 and 1")


@dataclass(frozen=True)
class Estimate:
    """The parameters that fit best, and how far they can be trusted.

    Parameters
    ----------
    design : Design
    settings : Settings
    comparison : Comparison; what was compared
    objective : (n_f, n_d) array; Φ at the nodes, m² for `fields`
    surrogate : LagrangeSurrogate of Φ
    loo_error : float; rms leave-one-out error of the surrogate, unit of Φ
    data_objective : float; Φ at the optimum from the interpolated data instead of the interpolated Φ
    data_position : (2,) array, N and m; where that Φ has its own minimum
    resolved : bool; the optimum is accepted, and a finer grid would leave it where it is beside noise and discrepancy
    minimum : Minimum of what `settings.surrogate` names
    valley : what was minimised: Φ of interpolated data, or the surrogate
    multinomial_minimum : Minimum of the surrogate, the paper's estimate
    others : tuple of Minimum; further local minima inside the grid that are no worse by more than loo_error
    refused : str; why the optimum is not accepted, empty where it is
    uncertainty : Uncertainty, or None where the optimum is not accepted
    certainty : float; the valley's weakest curvature over its scatter, see `curvature_certainty`
    displacement : (s, p, 2) array, m, or None; the simulated field at the optimum, interpolated over the grid
    load : (s,) array, N, or None; likewise
    left_out : tuple of str; data missing somewhere
    radial_position : (2,) array, N and m; the minimum with radial basis functions instead of multinomials
    placements : Placements that were averaged, or None
    """

    design: Design
    settings: Settings
    comparison: Comparison
    objective: np.ndarray
    surrogate: LagrangeSurrogate
    loo_error: float
    data_objective: float
    data_position: np.ndarray
    resolved: bool
    minimum: Minimum
    valley: SquaredDifference | LagrangeSurrogate
    multinomial_minimum: Minimum
    others: tuple[Minimum, ...]
    refused: str
    uncertainty: Uncertainty | None
    certainty: float
    displacement: np.ndarray | None
    load: np.ndarray | None
    left_out: tuple[str, ...]
    radial_position: np.ndarray
    placements: Placements | None = None

    @property
    def f_max(self) -> float:
        """N."""
        return float(self.minimum.position[0])

    @property
    def delta_max(self) -> float:
        """m."""
        return float(self.minimum.position[1])

    @property
    def bond_energy(self) -> float:
        """f_max·delta_max/2 (J); the fracture energy is it over r·t."""
        return self.f_max * self.delta_max / 2

    @property
    def interior(self) -> bool:
        """Whether the optimum lies inside the grid."""
        return self.minimum.interior

    @property
    def accepted(self) -> bool:
        """Whether the optimum passed every check, so that it has intervals."""
        return not self.refused

    @property
    def status(self) -> str:
        """How it ended, in a sentence."""
        return self.refused or self.minimum.status

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know before the numbers."""
        found = [self.refused] if self.refused else []
        if self.others:
            places = ", ".join(f"({m.position[0]:.3g} N, {m.position[1]:.3g} m)" for m in self.others)
            found.append(f"The grid cannot tell the optimum from other minima at {places}: refine it.")
        if self.accepted and self.certainty < CERTAIN:
            found.append(
                f"The weakest curvature at the optimum is only {self.certainty:.1f} times its scatter from node to "
                "node: the intervals are themselves unsure; widen the grid."
            )
        if self.accepted and not self.resolved:
            f_max, delta_max = self.data_position
            found.append(
                f"With interpolated data instead of an interpolated objective the optimum is ({f_max:.4g} N, "
                f'{delta_max:.3g} m), further off than noise and discrepancy explain: set surrogate = "data".'
            )
        if self.uncertainty is not None and self._swings(self.uncertainty):
            f_max, delta_max = self.radial_position
            found.append(
                f"Radial basis functions through the same simulations have their optimum at ({f_max:.4g} N, "
                f"{delta_max:.3g} m), more than a standard deviation away: the interpolation between nodes matters, "
                "use a finer grid."
            )
        return (*found, *self.left_out)

    def _swings(self, doubt: Uncertainty) -> bool:
        """Whether the second surrogate's optimum lies further off than a standard deviation in either parameter."""
        size = np.sqrt(np.diag(doubt.covariance))
        far = np.abs(self.radial_position - self.minimum.position) > size
        return bool(far.any()) and self.settings.surrogate is Surrogate.DATA


def estimate(
    design: Design,
    simulated: Simulated,
    measured: Measured,
    settings: Settings,
    placements: Placements | None = None,
) -> Estimate:
    """The paper's inverse estimation on a grid of simulations that have already been run.

    Φ at the nodes (eq. 5), its Lagrange multinomial and Newton's method from every node (eq. 6), then the
    checks and intervals of `uncertainty`. With `settings.surrogate = data` the multinomials run through the data.

    Parameters
    ----------
    design : Design
    simulated : Simulated; one entry a node
    measured : Measured
    settings : Settings
    placements : Placements near the optimum, whose mean then stands for the grid's one lattice, or None

    Raises
    ------
    InputError
        if measurement and simulations have too little in common
    """
    if placements is not None:
        placements = placements.comparable(measured)
        simulated = placements.averaged(simulated)
    comparison = compare(measured, simulated, settings.objective, settings.rigid)
    objective, features = differences(comparison, simulated)
    surrogate = LagrangeSurrogate(design.f_max, design.delta_max, objective)
    interpolated = LagrangeSurrogate(design.f_max, design.delta_max, features)
    by_data = settings.surrogate is Surrogate.DATA
    nodes = np.array(design.nodes())
    valley = SquaredDifference.of(interpolated, comparison.target) if by_data else surrogate
    best, *others = minimise(valley, nodes)
    loo_error = float(np.sqrt(np.mean(leave_one_out(surrogate) ** 2)))
    displacement, load = (_interpolated(design, a) for a in (simulated.displacement, simulated.load))
    placed = None if placements is None else placements.deviations(comparison)
    fit = Fit(comparison, surrogate, interpolated, load, best, by_data, placed)
    data_objective = float(np.sum(fit.residual**2))
    data_position = data_minimum(fit)
    refused = refusal(best, float(objective.min()), data_objective, loo_error)
    return Estimate(
        design=design,
        settings=settings,
        comparison=comparison,
        objective=objective,
        surrogate=surrogate,
        loo_error=loo_error,
        data_objective=data_objective,
        data_position=data_position,
        resolved=not refused and resolves(fit, data_position, settings.discrepancy),
        minimum=best,
        valley=valley,
        multinomial_minimum=minimise(surrogate, nodes)[0] if by_data else best,
        others=tuple(m for m in others if m.converged and m.interior and m.value <= best.value + loo_error),
        refused=refused,
        uncertainty=None
        if refused
        else uncertainty(fit, settings.discrepancy, settings.modulus_std, settings.confidence),
        certainty=curvature_certainty(fit),
        displacement=_at(displacement, best.position, simulated.displacement),
        load=_at(load, best.position, simulated.load),
        left_out=left_out(comparison),
        radial_position=radial_minimum(interpolated, comparison.target),
        placements=placements,
    )


def refusal(minimum: Minimum, lowest_node: float, data_objective: float, loo_error: float) -> str:
    """Why an optimum is not accepted, in a sentence; empty where it is.

    The multinomial must not dip below the smallest node by more than its leave-one-out error, unless the
    data do so too: a valley between nodes is deeper than the nodes on its sides, and there the sum of
    squares of the interpolated data, which knows nothing of the multinomial of Φ, is as low.

    Parameters
    ----------
    minimum : Minimum of the multinomial P
    lowest_node : float; the smallest Φ of the grid
    data_objective : float; Φ at the minimum from interpolated data
    loo_error : float; all in the unit of Φ
    """
    if not (minimum.converged and minimum.interior and minimum.convex):
        return minimum.status
    if minimum.value < 0:
        return (
            f"The multinomial is negative at its minimum ({minimum.value:.3g}); no sum of squares is: refine the grid."
        )
    floor = min(lowest_node, data_objective)
    if minimum.value < floor - loo_error:
        return (
            f"The multinomial at its minimum ({minimum.value:.3g}) lies below the smallest node ({lowest_node:.3g}) "
            f"and below the interpolated data's objective ({data_objective:.3g}) by more than its leave-one-out error "
            f"({loo_error:.3g}): refine the grid."
        )
    return ""


def _interpolated(design: Design, values: np.ndarray | None) -> LagrangeSurrogate | None:
    """A surrogate of simulated data; what is missing at any node is carried as zero and masked later."""
    if values is None:
        return None
    whole = np.isfinite(values).all(axis=(0, 1))
    return LagrangeSurrogate(design.f_max, design.delta_max, np.where(whole, values, 0.0))


def _at(surrogate: LagrangeSurrogate | None, position: np.ndarray, values: np.ndarray | None) -> np.ndarray | None:
    if surrogate is None or values is None:
        return None
    return np.where(np.isfinite(values).all(axis=(0, 1)), surrogate.value(position), np.nan)
