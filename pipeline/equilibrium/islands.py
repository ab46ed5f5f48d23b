"""Bonds that soften apart from the strip, one variable each.

The far field stays elastic with all its bonds; a softening bond in it is a pair of forces −q, its tension being
K^n δ − q. They add the opening η = C q to the elastic one, δ = A x + a s + η, and the energy of the far field is

    ½ (x, s)·S (x, s) + ½ η·C⁻¹η − ½ Σ K^n δ²     (the last term takes out what the bonds' own law counts)

with S the condensed elastic stiffness, C = J K⁻¹ Jᵀ the compliance of the far field between these bonds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

YIELD = 1e-6  # of 1/K^n: compliance given to every bond, for motions that the far field does not allow


@dataclass(frozen=True)
class Islands:
    """The k openings, or openings and slidings, of the bonds that soften in the far field.

    Parameters
    ----------
    index : (k,) int array; what softens, numbered as the deformations of the whole model: openings of bonds, and
        slidings where these slide
    row : (k, b + 1) array; A and a: opening by the edge of the strip and by the machine, of the elastic far field
    compliance : (k, k) array C, m/N, and its inverse, N/m
    jacobian : (k, f) sparse array; their opening by the eliminated variables
    k_n : (k,) array, N/m; their elastic stiffness
    """

    index: np.ndarray
    row: np.ndarray
    compliance: np.ndarray
    inverse: np.ndarray
    jacobian: sparse.csr_array
    k_n: np.ndarray

    @property
    def count(self) -> int:
        return self.index.size

    def opening(self, moved: np.ndarray, extra: np.ndarray) -> np.ndarray:
        """δ (k,), m, for edge and machine (b + 1,), m, and η (k,), m."""
        return self.row @ moved + extra

    def pull(self, force: np.ndarray, moved: np.ndarray, extra: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (b + 1,) on edge and machine beyond the elastic ones, and (k,) on η, N, for bond forces (k,), N."""
        lack = force - self.k_n * self.opening(moved, extra)
        return lack @ self.row, self.inverse @ extra + lack

    def energy(self, moved: np.ndarray, extra: np.ndarray) -> float:
        """J, beyond the elastic energy of edge and machine."""
        opening = self.opening(moved, extra)
        return 0.5 * float(extra @ self.inverse @ extra - self.k_n @ opening**2)

    def tension_lost(self, extra: np.ndarray) -> np.ndarray:
        """q (k,), N, that goes with η (k,), m."""
        return self.inverse @ extra


def no_islands(edge: int, inner: int) -> Islands:
    """None, beside an edge of so many variables and so many eliminated ones."""
    none = np.zeros((0, 0))
    bonds = sparse.csr_array((0, inner))
    return Islands(np.zeros(0, int), np.zeros((0, edge + 1)), none, none, bonds, np.zeros(0))


def joined(
    before: Islands,
    index: np.ndarray,
    row: np.ndarray,
    columns: np.ndarray,
    jacobian: sparse.csr_array,
    k_n: np.ndarray,
) -> Islands:
    """The islands with further bonds.

    Parameters
    ----------
    index : (k,) int array; the new bonds
    row : (k, b + 1) array; their rows A and a
    columns : (f, k) array K⁻¹Jᵀ, m/N; eliminated variables under a unit tension lost in each new bond
    jacobian, k_n : of the new bonds
    """
    across, own = before.jacobian @ columns, jacobian @ columns
    compliance = np.block([[before.compliance, across], [across.T, (own + own.T) / 2]])
    stiffness = np.append(before.k_n, k_n)
    inverse = _inverse(compliance, np.sqrt(stiffness))
    return Islands(
        index=np.append(before.index, index),
        row=np.vstack([before.row, row]),
        compliance=compliance,
        inverse=inverse,
        jacobian=sparse.vstack([before.jacobian, jacobian]).tocsr(),
        k_n=stiffness,
    )


def _inverse(compliance: np.ndarray, root: np.ndarray) -> np.ndarray:
    """C⁻¹ (k, k), where `root` (k,) is √K^n; every bond yields by `YIELD`, so that it exists.

    The eigenvalues of √K^n C √K^n lie between 0, bonds being statically indeterminate among themselves, and 1.
    """
    share = root[:, None] * compliance * root
    share[np.diag_indices_from(share)] += YIELD
    inverse = linalg.cho_solve(linalg.cho_factor(share, check_finite=False), np.eye(root.size), check_finite=False)
    return root[:, None] * (inverse + inverse.T) / 2 * root
