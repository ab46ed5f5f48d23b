"""Uncertainty of a least-squares fit whose neighbouring residuals go together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STRONGEST = 0.97  # correlation of neighbours; beyond it a wave is longer than any record
STEPS = 50
MOST = 300  # residuals; more are averaged in runs of equal length


@dataclass(frozen=True)
class CorrelatedScatter:
    """Covariance of p constants fitted to n readings.

    Parameters
    ----------
    correlation : float; of neighbouring readings, mean over what the residuals allow
    degrees : float; of freedom behind the scatter (Satterthwaite), for Student's t
    covariance : (p, p) array
    independent : (p, p) array; s² (JᵀJ)⁻¹, what it would be if residuals were independent
    """

    correlation: float
    degrees: float
    covariance: np.ndarray
    independent: np.ndarray


def correlated_scatter(residual: np.ndarray, slope: np.ndarray, group: np.ndarray) -> CorrelatedScatter:
    """Covariance of fitted constants when errors are a first-order autoregression along the record.

    A smooth law that does not quite fit leaves waves; each counts about once, not as often as it was read. The
    correlation ρ of neighbours cannot be read off the residuals, from which the fit has taken its part: its
    *restricted* likelihood is used (Patterson and Thompson 1971), and, since short records hardly tell ρ, the
    covariance is averaged over it with equal prior weight from 0 to 0.97:

        cov = Σ w(ρ) s²(ρ) (JᵀJ)⁻¹ Jᵀ R(ρ) J (JᵀJ)⁻¹,    s² = rᵀr/tr(P R P),    P = 1 − J (JᵀJ)⁻¹ Jᵀ.

    Parameters
    ----------
    residual : (n,) array, in the order in which neighbours may go together; n > p
    slope : (n, p) array; J, derivative of the residuals after the constants, of full rank
    group : (n,) array, not falling; readings of one value (replicates at one time) are averaged first
    """
    r, j = _thinned(residual, slope, group)
    if r.size <= j.shape[1]:  # replicates of few times: nothing is left to tell ρ by
        r, j = residual, slope
    n, p = j.shape
    q, _ = np.linalg.qr(j)
    back = np.linalg.pinv(j)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    rho = np.linspace(0, STRONGEST, STEPS)
    rows = [_at(value, r, j, q, back, lag) for value in rho]
    weight = np.exp(np.array([row[0] for row in rows]) - max(row[0] for row in rows))
    weight /= weight.sum()
    covariance = np.einsum("k,kij->ij", weight, np.array([row[2] for row in rows]))
    independent = float(r @ r) / (n - p) * back @ back.T
    return CorrelatedScatter(float(weight @ rho), float(weight @ [row[1] for row in rows]), covariance, independent)


def _at(
    rho: float, r: np.ndarray, j: np.ndarray, q: np.ndarray, back: np.ndarray, lag: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """Restricted log-likelihood, degrees of freedom and covariance at one correlation."""
    n, p = j.shape
    y, x = _whitened(r, rho), _whitened(j, rho)
    beta, *_ = np.linalg.lstsq(x, y, rcond=None)
    rest = y - x @ beta
    _, information = np.linalg.slogdet(x.T @ x)
    likelihood = -0.5 * (n - 1) * np.log1p(-(rho**2)) - 0.5 * information
    likelihood -= 0.5 * (n - p) * np.log(max(float(rest @ rest), np.finfo(float).tiny))
    spread = rho**lag
    inner = q.T @ spread @ q
    trace = n - float(np.trace(inner))  # of P R P
    squared = float(np.sum(spread**2)) - 2 * float(np.sum((spread @ q) ** 2)) + float(np.sum(inner**2))
    return likelihood, trace**2 / squared, float(r @ r) / trace * back @ spread @ back.T


def _whitened(values: np.ndarray, rho: float) -> np.ndarray:
    """Values (n, …) of unit variance and neighbours correlated by ρ, made independent."""
    out = values.copy()
    out[1:] = (values[1:] - rho * values[:-1]) / np.sqrt(1 - rho**2)
    return out


def _thinned(residual: np.ndarray, slope: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums over readings of one value, then over runs where there are too many, each over the root of its count."""
    _, place = np.unique(group, return_inverse=True)
    count = int(place.max()) + 1
    if count > MOST:
        place = place * MOST // count
    root = np.sqrt(np.bincount(place))
    columns = [np.bincount(place, column) / root for column in slope.T]
    return np.bincount(place, residual) / root, np.column_stack(columns)
