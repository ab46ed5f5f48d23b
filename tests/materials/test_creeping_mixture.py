"""Bonds of a mixture whose mastic creeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.particles import Phase
from pipeline.core.units import GPA
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_mixture import creeping_arms, creeping_law
from pipeline.materials.elastic import Plane
from pipeline.materials.mixture import Mixture
from pipeline.materials.relaxation import relax, total

MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)
MIXTURE = Mixture(10 * GPA, 50 * GPA, 0.25, Plane.STRAIN, 71.0, 1.14e-4)
PHASE = np.array([Phase.TOUCHING, Phase.MASTIC, Phase.INTERFACE, Phase.AGGREGATE, Phase.MASTIC])


def test_at_once_the_stiffness_is_that_of_the_elastic_mixture():
    # 1/D₁ is the elastic mixture's modulus of the mastic, so also the interface agrees: series = mean compliance
    found = creeping_arms(MIXTURE, MASTIC, PHASE, 0.04)
    assert found.instantaneous == pytest.approx(MIXTURE.stiffness(PHASE, 0.04), rel=1e-12)  # a dozen roundings


def test_each_phase_relaxes_as_its_material():
    bonds = creeping_arms(MIXTURE, MASTIC, PHASE, 0.04)
    jump = np.full(PHASE.size, 1e-6)
    force = relax(bonds, relax(bonds, bonds.relaxed(), jump, 0.0), 0 * jump, 200.0)
    kept = total(bonds, force, jump) / (bonds.instantaneous * 1e-6)
    interface = MASTIC.averaged_with_elastic(50 * GPA)
    share = {
        Phase.MASTIC: MASTIC.relaxation_modulus(200.0) * MASTIC.d1,
        Phase.INTERFACE: interface.relaxation_modulus(200.0) * interface.d1,
        Phase.AGGREGATE: 1.0,
        Phase.TOUCHING: 1.0,
    }
    assert kept == pytest.approx([share[p] for p in PHASE], rel=1e-12)  # exponentials
    assert share[Phase.MASTIC] < share[Phase.INTERFACE] < 1


def test_strength_is_that_of_the_mixture_and_protected_bonds_have_none():
    problem = small_beam()
    law = creeping_law(MIXTURE, MASTIC, problem.bonds, 0.04, 71.0, 1.14e-4)
    elastic = replace(MIXTURE, mastic_modulus=1 / MASTIC.d1).law(problem.bonds, 0.04, 71.0, 1.14e-4)
    assert np.isinf(law.f_max[problem.bonds.protected]).all()
    free = ~problem.bonds.protected
    assert law.f_max[free].tolist() == elastic.f_max[free].tolist()
    assert law.delta_max[free].tolist() == elastic.delta_max[free].tolist()
    # loaded in no time, the creeping law is the elastic one
    openings = np.random.default_rng(0).uniform(-1e-6, 1.2e-4, free.size)
    force = law.force(law.at_rest(), openings, 0.0)
    assert force == pytest.approx(elastic.force(openings, np.zeros(free.size)), rel=1e-9, abs=1e-7)  # near zero: f_max
