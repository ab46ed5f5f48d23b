"""The creep test of the mastic that lies in every bundle on which the diagnosis is tried."""

from __future__ import annotations

import numpy as np

from pipeline.core.units import GPA
from pipeline.store.creep import CreepRecord
from pipeline.store.experiment import Experiment

SHARE, FLOW, TIME = 0.3, 600.0, 12.0  # D₂/D₁, η₁ D₁ in s, τ₂ in s
AT = np.geomspace(0.1, 300.0, 40)  # s


def creep_record(experiment: Experiment) -> CreepRecord:
    """Compliance of a Burgers body whose instant stiffness is the mastic's."""
    assert experiment.material.mastic_modulus_gpa is not None
    d1 = 1 / (experiment.material.mastic_modulus_gpa * GPA)
    growth = AT / FLOW + SHARE * -np.expm1(-AT / TIME)
    return CreepRecord(AT, d1 * (1 + growth))
