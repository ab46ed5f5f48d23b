"""The triangles between the edges: elastic stone, and mastic that is elastic or a chain of Maxwell elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from pipeline.blind.body import Body


def elasticity(poissons_ratio: float, plane: str) -> np.ndarray:
    """(3, 3) matrix at unit modulus: strain (xx, yy, 2xy) → stress."""
    nu = poissons_ratio
    if plane == "strain":
        share = 1 / ((1 + nu) * (1 - 2 * nu))
        return share * np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
    return 1 / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])


@dataclass(frozen=True)
class Relaxation:
    """Relaxation of the mastic relative to its instantaneous modulus: Σ weightᵢ e^(−t/timeᵢ), weights summing to 1."""

    weight: tuple[float, ...] = ()
    time: tuple[float, ...] = ()

    def lasting(self, span: float) -> np.ndarray:
        """Mean of each element's decay over a span (s)."""
        share = span / np.asarray(self.time)
        return -np.expm1(-share) / share


def burgers_relaxation(d1: float, d2: float, eta1: float, tau2: float) -> Relaxation:
    """Relaxation of a Burgers fluid D(t) = D₁ + t/η₁ + D₂(1 − e^(−t/τ₂)).

    With Ẽ = 1/(s D̃) = (1 + τ₂ s)/(D₁ τ₂ s² + (D₁ + D₂ + τ₂/η₁) s + 1/η₁): two poles, −1/timeᵢ, and their residues.
    d1, d2 : 1/Pa; eta1 : Pa s; tau2 : s
    """
    a, b, c = d1 * tau2, d1 + d2 + tau2 / eta1, 1 / eta1
    root = np.sqrt(b * b - 4 * a * c)
    poles = np.array([(-b - root) / (2 * a), 2 * c / (-b - root)])
    weight = d1 * (1 + tau2 * poles) / (a * (poles - poles[::-1]))
    return Relaxation(tuple(weight.tolist()), tuple((-1 / poles).tolist()))


@dataclass(frozen=True, eq=False)
class Memory:
    """Stresses (elements, t, 3), Pa, of the Maxwell elements."""

    stress: np.ndarray


@dataclass(frozen=True, eq=False)
class Bulk:
    """All triangles.

    Parameters
    ----------
    elasticity : (3, 3) array at unit modulus
    modulus : (t,) array, Pa; instantaneous
    creeps : (t,) bool
    relaxation : Relaxation of those that creep; empty: none does
    """

    elasticity: np.ndarray
    modulus: np.ndarray
    creeps: np.ndarray
    relaxation: Relaxation

    def fresh(self) -> Memory:
        """Before the test."""
        return Memory(np.zeros((len(self.relaxation.weight), len(self.modulus), 3)))

    def stiffness(self, body: Body, span: float) -> csr_matrix:
        """Stiffness of an increment of so many seconds, N/m; span 0: at once."""
        return body.bulk(self.elasticity, self.modulus * self._left(span))

    def _left(self, span: float) -> np.ndarray:
        if not self.relaxation.weight or span <= 0:
            return np.ones(len(self.modulus))
        lasting = float(np.asarray(self.relaxation.weight) @ self.relaxation.lasting(span))
        return np.where(self.creeps, lasting, 1.0)

    def history(self, body: Body, memory: Memory, moved: np.ndarray, span: float) -> np.ndarray:
        """Forces (size,), N, that remain of earlier stresses, over the increment's stiffness times displacement."""
        if not self.relaxation.weight:
            return np.zeros(body.size)
        decayed = np.exp(-span / np.asarray(self.relaxation.time))
        left = np.einsum("e,etk->tk", decayed, memory.stress) * self.creeps[:, None]
        strain = np.einsum("tai,ti->ta", body.strain, moved[body.own])
        soft = (self.modulus * self._left(span) * self.creeps)[:, None] * (strain @ self.elasticity)
        return body.forces(left - soft)

    def remember(self, body: Body, memory: Memory, step: np.ndarray, span: float) -> Memory:
        """Stresses after an increment of displacement (size,), m."""
        if not self.relaxation.weight:
            return memory
        strain = np.einsum("tai,ti->ta", body.strain, step[body.own])
        change = (self.modulus * self.creeps)[:, None] * (strain @ self.elasticity)
        decayed = np.exp(-span / np.asarray(self.relaxation.time))
        grown = np.asarray(self.relaxation.weight) * self.relaxation.lasting(span)
        return Memory(decayed[:, None, None] * memory.stress + grown[:, None, None] * change)

    def stored(self, body: Body, memory: Memory, moved: np.ndarray) -> float:
        """Energy (J) in the triangles; in creeping ones that of the Maxwell springs."""
        strain = np.einsum("tai,ti->ta", body.strain, moved[body.own])
        density = 0.5 * self.modulus * np.einsum("ta,ab,tb->t", strain, self.elasticity, strain)
        if self.relaxation.weight:
            soft = np.linalg.inv(self.elasticity)
            share = np.einsum(
                "eta,ab,etb,e->t", memory.stress, soft, memory.stress, 1 / np.asarray(self.relaxation.weight)
            )
            density = np.where(self.creeps, 0.5 * share / self.modulus, density)
        return float(density @ (body.mesh.area * body.thickness))
