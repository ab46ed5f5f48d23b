"""Multivariate Lagrange interpolation over the grid of simulations (Hill et al. 2017, eq. 6)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class LagrangeSurrogate:
    """P(f_max, delta_max) = Σ_p Σ_q values_pq ℓ_p(f_max) ℓ_q(delta_max), with its exact derivatives.

    Values may be numbers (the objective) or arrays (a displacement field at every node). Inside, both
    parameters are scaled to [−1, 1] over the grid.

    Parameters
    ----------
    f_nodes : (n_f,) array, N, increasing, at least 2
    d_nodes : (n_d,) array, m, increasing, at least 2
    values : (n_f, n_d, ...) array, finite
    """

    f_nodes: np.ndarray
    d_nodes: np.ndarray
    values: np.ndarray

    def __post_init__(self) -> None:
        for name, nodes in (("f_max", self.f_nodes), ("delta_max", self.d_nodes)):
            if len(nodes) < 2 or not (np.diff(nodes) > 0).all():
                raise InputError(f"grid lines of {name} must be increasing and at least two, got {np.asarray(nodes)}")
        if self.values.shape[:2] != (len(self.f_nodes), len(self.d_nodes)):
            raise InputError(
                f"a grid of {len(self.f_nodes)} × {len(self.d_nodes)} needs as many values, got {self.values.shape[:2]}"
            )
        if not np.isfinite(self.values).all():
            bad = np.argwhere(~np.isfinite(self.values))[0]
            raise InputError(f"the value at node {tuple(bad[:2].tolist())} is not finite: run that simulation again")

    @property
    def lower(self) -> np.ndarray:
        return np.array([self.f_nodes[0], self.d_nodes[0]])

    @property
    def upper(self) -> np.ndarray:
        return np.array([self.f_nodes[-1], self.d_nodes[-1]])

    def value(self, parameters: np.ndarray) -> np.ndarray:
        """P at (f_max, delta_max); shape of one node's value."""
        f, d = self._bases(parameters, 1)
        return self._sum(f[0], d[0])

    def gradient(self, parameters: np.ndarray) -> np.ndarray:
        """∂P/∂f_max (per N) and ∂P/∂delta_max (per m); (2, ...)."""
        f, d = self._bases(parameters, 2)
        return np.stack([self._sum(f[1], d[0]), self._sum(f[0], d[1])])

    def hessian(self, parameters: np.ndarray) -> np.ndarray:
        """Second derivatives; (2, 2, ...)."""
        f, d = self._bases(parameters, 3)
        mixed = self._sum(f[1], d[1])
        return np.stack([np.stack([self._sum(f[2], d[0]), mixed]), np.stack([mixed, self._sum(f[0], d[2])])])

    def on_grid(self, f_max: np.ndarray, delta_max: np.ndarray) -> np.ndarray:
        """P on another tensor grid, for pictures; (len(f_max), len(delta_max), ...)."""
        f = np.stack([_basis(self._tables[0], x, 1)[0] for x in f_max])
        d = np.stack([_basis(self._tables[1], x, 1)[0] for x in delta_max])
        return np.einsum("ap,bq,pq...->ab...", f, d, self.values)

    def of_nodes(self) -> LagrangeSurrogate:
        """The weights ℓ_p ℓ_q that the nodes have in the sum, as a surrogate of their own; (n_f, n_d) a point."""
        count = len(self.f_nodes) * len(self.d_nodes)
        return replace(self, values=np.eye(count).reshape(*self.values.shape[:2], *self.values.shape[:2]))

    @cached_property
    def _tables(self) -> tuple[_Table, _Table]:
        return _table(self.f_nodes), _table(self.d_nodes)

    def _bases(self, parameters: np.ndarray, orders: int) -> tuple[np.ndarray, np.ndarray]:
        f_table, d_table = self._tables
        return _basis(f_table, parameters[0], orders), _basis(d_table, parameters[1], orders)

    def _sum(self, f: np.ndarray, d: np.ndarray) -> np.ndarray:
        if self.values.ndim == 2:
            return f @ self.values @ d
        weights = (f[:, None] * d).ravel()
        return np.reshape(weights @ self._rows, self.values.shape[2:])

    @cached_property
    def _rows(self) -> np.ndarray:
        """Values of the nodes, one row a node."""
        return np.reshape(self.values, (len(self.f_nodes) * len(self.d_nodes), -1))


class _Table(NamedTuple):
    """What the polynomials on one set of nodes share; others (n, n − 1) scaled nodes, scale (n,) Π(t_p − t_m)."""

    first: float
    half: float
    others: np.ndarray
    scale: np.ndarray


def _table(nodes: np.ndarray) -> _Table:
    nodes = np.asarray(nodes, float)
    half = (nodes[-1] - nodes[0]) / 2
    t = (nodes - nodes[0]) / half
    others = np.broadcast_to(t, (t.size, t.size))[~np.eye(t.size, dtype=bool)].reshape(t.size, t.size - 1)
    return _Table(float(nodes[0]), float(half), others, np.prod(t[:, None] - others, axis=1))


def _basis(table: _Table, x: float, orders: int) -> np.ndarray:
    """The lowest coefficients of Π (t + s − t_m) in s: value, first derivative, half the second."""
    offset = (x - table.first) / table.half - table.others
    if orders == 1:  # by far the most often
        return (offset.prod(axis=1) / table.scale)[None]
    series = np.zeros((orders, len(offset)))
    series[0] = 1.0
    for factor in offset.T:
        series[1:] = series[1:] * factor + series[:-1]
        series[0] *= factor
    series /= table.scale
    series[1:2] /= table.half
    series[2:3] *= 2 / table.half**2
    return series


def lagrange_basis(nodes: np.ndarray, x: float, orders: int) -> np.ndarray:
    """The Lagrange polynomials of `nodes` at x, and their first derivatives where asked for.

    Written as products over scaled distances, so nothing is divided by zero at a node; derivatives are the
    next coefficients of the same product.

    Parameters
    ----------
    nodes : (n,) array, any unit
    x : float, the same unit
    orders : int; 1 values, 2 and first derivatives, 3 and second derivatives

    Returns
    -------
    (orders, n) array
    """
    return _basis(_table(nodes), x, orders)


def leave_one_out(surrogate: LagrangeSurrogate) -> np.ndarray:
    """Errors at nodes that are predicted from the other nodes of their own grid line.

    Every node that is not an end of its row (column) is predicted by the Lagrange polynomial, one degree
    lower, through the other nodes of that row (column). Ends are left out: predicting them would be
    extrapolation, which the surrogate is never used for.

    Parameters
    ----------
    surrogate : LagrangeSurrogate of numbers

    Returns
    -------
    (k,) array, unit of the values; k = (n_f − 2) n_d + n_f (n_d − 2)
    """
    along_f = _line_errors(surrogate.f_nodes, surrogate.values)
    along_d = _line_errors(surrogate.d_nodes, surrogate.values.T)
    return np.concatenate([along_f.ravel(), along_d.ravel()])


def node_scatter(surrogate: LagrangeSurrogate) -> tuple[float, int]:
    """Standard deviation of what changes from node to node without order, and its degrees of freedom.

    The values are split into orthonormal polynomials of the two parameters. A smooth function lives in the
    low degrees, independent scatter (crack paths that change from node to node) equally in all: its variance
    is the mean square of the coefficients whose degrees a, b satisfy a/(n_f − 1) + b/(n_d − 1) > 1.

    Parameters
    ----------
    surrogate : LagrangeSurrogate of numbers, at least three lines either way
    """
    variance, freedom = node_covariance(replace(surrogate, values=surrogate.values[..., None]))
    return float(np.sqrt(variance[0, 0])), freedom


def node_covariance(surrogate: LagrangeSurrogate) -> tuple[np.ndarray, int]:
    """The same of several values a node together: covariance (k, k) of their scatter, and its degrees of freedom.

    Parameters
    ----------
    surrogate : LagrangeSurrogate of (k,) arrays, at least three lines either way
    """
    f, d = _orthonormal(surrogate.f_nodes), _orthonormal(surrogate.d_nodes)
    coefficients = np.einsum("pa,pqk,qb->abk", f, surrogate.values, d)
    n_f, n_d = coefficients.shape[:2]
    high = coefficients[np.add.outer(np.arange(n_f) / (n_f - 1), np.arange(n_d) / (n_d - 1)) > 1 + 1e-9]
    return high.T @ high / len(high), len(high)


def _orthonormal(nodes: np.ndarray) -> np.ndarray:
    """Polynomials of rising degree, orthonormal over the nodes; (n, n), one a column."""
    t = (nodes - nodes[0]) / (nodes[-1] - nodes[0]) * 2 - 1
    return np.linalg.qr(np.vander(t, increasing=True))[0]


def _line_errors(nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Prediction − value along the first axis, for all but its ends."""
    error = np.empty((len(nodes) - 2, values.shape[1]))
    for k in range(1, len(nodes) - 1):
        weight = lagrange_basis(np.delete(nodes, k), nodes[k], 1)[0]
        error[k - 1] = weight @ np.delete(values, k, axis=0) - values[k]
    return error
