"""The four constants of a Burgers model from a creep record, and how well the record knows them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.stats import t as student

from pipeline.core.errors import InputError
from pipeline.core.units import GPA
from pipeline.materials.burgers import Burgers
from pipeline.materials.correlated_scatter import correlated_scatter
from pipeline.materials.series_fit import creep_design, not_negative, refuse_data

NAMES = ("d1", "d2", "eta1", "tau2")
FEWEST, NARROWEST = 6, 10.0  # readings, and last over first time: four constants need as much
CONFIDENCE = 0.95
STARTS = 3  # best of the retardation times tried


@dataclass(frozen=True)
class BurgersFit:
    """A fit in logarithms.

    Parameters
    ----------
    model : Burgers
    time : (n,) array, s
    compliance : (n,) array, 1/Pa
    covariance : (4, 4) array; of the logarithms of d1, d2, eta1, tau2
    inflation : (4,) array; by which correlated residuals enlarge the variances
    degrees : float; of freedom behind them
    correlation : float; of neighbouring residuals
    """

    model: Burgers
    time: np.ndarray
    compliance: np.ndarray
    covariance: np.ndarray
    inflation: np.ndarray
    degrees: float
    correlation: float

    @cached_property
    def interval(self) -> dict[str, tuple[float, float]]:
        """Name → (low, high) of 95 % in SI, NaN where the record sets no bound.

        The interval of a constant holds the values at which the best fit of the three others has a sum of
        squares below S_min (1 + c t²/(n − 4)), t Student's 95 % point and c the inflation by correlated
        residuals; so a constant that the record does not show is unbounded on that side, not precise by accident.
        """
        squares, count = float(self.residual @ self.residual), self.time.size
        bounds, best = _bounds(self.time, self.compliance), _logs(self.model)
        std = np.sqrt(np.diag(self.covariance))
        found = {}
        for k, name in enumerate(NAMES):
            allowed = 1 + self.inflation[k] * self._student**2 / (count - 4)
            limit = max(squares * allowed, squares + 1e-24 * count)
            found[name] = _Profile(self.time, self.compliance, *bounds, best, limit).interval(k, float(std[k]))
        return found

    @property
    def _student(self) -> float:
        return float(student.ppf((1 + CONFIDENCE) / 2, self.degrees))

    @cached_property
    def residual(self) -> np.ndarray:
        """ln(model/measured) (n,)."""
        return np.log(self.model.creep_compliance(self.time) / self.compliance)

    @property
    def rms_log_error(self) -> float:
        """Root mean square of ln(model/measured)."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Constants of which the record gives no bound on one side or both."""
        return tuple(name for name in NAMES if np.isnan(self.interval[name]).any())

    def band(self, value: Callable[[Burgers], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """95 % band (n,) each of a positive function of the model, to first order in the logarithms."""
        centre = np.log(value(self.model))
        step = 1e-5
        theta = _logs(self.model)
        slope = np.array([np.log(value(_model(theta + step * e))) - centre for e in np.eye(4)]) / step
        half = self._student * np.sqrt(np.einsum("in,ij,jn->n", slope, self.covariance, slope))
        return np.exp(centre - half), np.exp(centre + half)


def fit_burgers(time: np.ndarray, compliance: np.ndarray) -> BurgersFit:
    """Least squares of ln D, from the best of many retardation times.

    Parameters
    ----------
    time : (n,) array, s, positive; in any order, replicates may share times
    compliance : (n,) array, 1/Pa, positive

    Raises
    ------
    InputError
        for fewer than 6 readings, less than a decade of time, or a compliance that does not grow
    """
    refuse_data(time, compliance, "compliance", "1/Pa")
    order = np.argsort(time, kind="stable")
    time, compliance = np.asarray(time, float)[order], np.asarray(compliance, float)[order]
    _refuse_poor(time, compliance)
    low, high = _bounds(time, compliance)
    best = min((_refined(time, compliance, s, low, high) for s in _starts(time, compliance)), key=lambda r: r.cost)
    free = (best.x > low + 1e-6) & (best.x < high - 1e-6)  # constants at a bound are taken as known
    scatter = correlated_scatter(best.fun, best.jac[:, free], time)
    covariance, inflation = np.zeros((4, 4)), np.ones(4)
    covariance[np.ix_(free, free)] = scatter.covariance
    own = np.diag(scatter.independent)
    inflation[free] = np.divide(np.diag(scatter.covariance), own, out=np.ones_like(own), where=own > 0)
    inflation[~free] = inflation[free].max(initial=1.0)
    return BurgersFit(_model(best.x), time, compliance, covariance, inflation, scatter.degrees, scatter.correlation)


@dataclass(frozen=True)
class _Profile:
    """The sum of squares as a function of one logarithm, the three others being fitted."""

    time: np.ndarray
    compliance: np.ndarray
    low: np.ndarray
    high: np.ndarray
    best: np.ndarray
    limit: float

    def interval(self, k: int, std: float) -> tuple[float, float]:
        """Where the sum of squares passes the limit on either side; NaN where it does not."""
        return self._side(k, -max(std, 1e-9)), self._side(k, max(std, 1e-9))

    def _side(self, k: int, step: float) -> float:
        bound = self.high[k] if step > 0 else self.low[k]
        inside, others = float(self.best[k]), self.best
        while abs(inside - bound) > 1e-9:
            outside = float(np.clip(inside + step, min(inside, bound), max(inside, bound)))
            above, others = self._above(k, outside, others)
            if above > 0:
                return self._crossing(k, inside, outside, others)
            inside, step = outside, 2 * step
        return float("nan")

    def _crossing(self, k: int, inside: float, outside: float, others: np.ndarray) -> float:
        """The constant, not its logarithm, at which the limit is passed."""
        return float(np.exp(brentq(lambda value: self._above(k, value, others)[0], inside, outside, xtol=1e-4)))

    def _above(self, k: int, value: float, others: np.ndarray) -> tuple[float, np.ndarray]:
        """How far the sum of squares lies above the limit with constant k held, and the fit of the others."""
        free = np.arange(4) != k
        fit = _refined(self.time, self.compliance, np.where(free, others, value), self.low, self.high, free)
        whole = np.where(free, 0.0, value)
        whole[free] = fit.x
        return 2 * fit.cost - self.limit, whole


def _refined(
    time: np.ndarray,
    compliance: np.ndarray,
    start: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    free: np.ndarray | None = None,
) -> Any:
    """Result of `least_squares` from a start, in the free logarithms."""
    free = np.ones(4, bool) if free is None else free
    fixed = np.clip(start, low, high)

    def whole(theta: np.ndarray) -> np.ndarray:
        full = fixed.copy()
        full[free] = theta
        return full

    def residual(theta: np.ndarray) -> np.ndarray:
        return np.log(_model(whole(theta)).creep_compliance(time) / compliance)

    def slope(theta: np.ndarray) -> np.ndarray:
        return _slope(whole(theta), time)[:, free]

    bounds = (low[free], high[free])
    inner = np.clip(fixed[free], low[free] + 1e-9, high[free] - 1e-9)
    stop = 1e-12 if free.all() else 1e-6  # a profile is read to 1e-4
    return least_squares(residual, inner, slope, bounds=bounds, xtol=stop, ftol=stop, gtol=1e-12)


def _slope(theta: np.ndarray, time: np.ndarray) -> np.ndarray:
    """∂ ln D/∂(ln d1, ln d2, ln eta1, ln tau2), (n, 4)."""
    model = _model(theta)
    x = time / model.tau2
    parts = [model.d1 + 0 * time, -model.d2 * np.expm1(-x), -time / model.eta1, -model.d2 * x * np.exp(-x)]
    return np.column_stack(parts) / model.creep_compliance(time)[:, None]


def _starts(time: np.ndarray, compliance: np.ndarray) -> list[np.ndarray]:
    """Constants to begin with: of many retardation times those whose best linear fit is closest."""
    found = []
    for tau2 in np.geomspace(time[0] / 3, 3 * time[-1], 25):
        design = creep_design(time, np.array([tau2]), True) / compliance[:, None]
        size = not_negative(design, np.ones_like(time))
        with np.errstate(divide="ignore"):
            theta = np.log([size[0], size[2], 1 / size[1] if size[1] else np.inf, tau2])
        found.append((float(np.linalg.norm(design @ size - 1)), theta))
    return [theta for _, theta in sorted(found, key=lambda pair: pair[0])[:STARTS]]


def _bounds(time: np.ndarray, compliance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms between which the constants lie: beyond them they would change D by 1e-4 at most."""
    least, most, first, last = compliance.min(), compliance.max(), time[0], time[-1]
    low = [1e-4 * least, 1e-4 * least, 0.1 * first / most, 0.1 * first]
    high = [2 * most, 1e3 * most, 1e4 * last / least, 100 * last]
    return np.log(low), np.log(high)


def _model(theta: np.ndarray) -> Burgers:
    return Burgers(*(float(value) for value in np.exp(theta)))


def _logs(model: Burgers) -> np.ndarray:
    return np.log([getattr(model, name) for name in NAMES])


def _refuse_poor(time: np.ndarray, compliance: np.ndarray) -> None:
    """Refuse a record that cannot hold four constants."""
    if time.size < FEWEST:
        raise InputError(f"{time.size} readings of creep compliance: a Burgers fit needs at least {FEWEST}")
    if time[-1] < NARROWEST * time[0]:
        raise InputError(
            f"the creep record runs from {time[0]:g} to {time[-1]:g} s: a Burgers fit needs at least a decade of "
            "time, as in 1 to 1000 s"
        )
    third = max(time.size // 3, 1)
    if compliance[-third:].mean() <= compliance[:third].mean():
        raise InputError(
            f"the creep compliance does not grow, from {compliance[:third].mean() * GPA:.4g} to "
            f"{compliance[-third:].mean() * GPA:.4g} 1/GPa: is it a modulus, or another column?"
        )
