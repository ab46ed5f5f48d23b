"""Effects in virtual tests: the record is spoiled as the formulas say, the network carries what it should."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError, UnavailableError
from pipeline.core.field import DisplacementField
from pipeline.core.particles import Phase
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.gap.effects import effect, library
from pipeline.gap.observation import Reading, Sight
from pipeline.gap.plan import Plan
from pipeline.materials.elastic import Plane
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.mixture import Mixture
from pipeline.twin.effects import SPOILED, Record, refuse_unknown, spoiled, walked, with_voids
from pipeline.twin.problem import one_phase

BEAM = SingleEdgeNotchedBeam(60e-3, 130e-3, 137e-3, 40e-3, 15e-3)
MIXTURE = Mixture(10e9, 50e9, 0.25, Plane.STRAIN, 71.0, 1.14e-4)
RATE = 1e-5  # m/s


def record() -> Record:
    time = np.linspace(0, 60, 301)
    cmod = RATE * time
    x, y = np.meshgrid(np.linspace(-20e-3, 20e-3, 9), np.linspace(5e-3, 45e-3, 9))
    points = np.column_stack([x.ravel(), y.ravel()])
    frames = np.linspace(0, 60, 31)
    field = 1e-3 * RATE * frames[:, None, None] * np.stack([points[:, 0] ** 2 * 3e5, points[:, 1] * 1e3], axis=-1)
    shape = (frames.size, len(points))
    return Record(
        LoadCurve(time, cmod, 2e3 * np.sin(time / 40)),
        DisplacementField(points, field, np.ones(shape, bool), np.zeros(shape), frames),
        BEAM,
        heading=0.6,
    )


def diagnosed(of: Record, name: str, amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the diagnosis believes to be read of this record under an effect, at stations of the CMOD that is read."""
    stations = RATE * np.array([12.0, 24.0, 36.0, 48.0])
    points = of.field.points
    low, high = points.min(axis=0), points.max(axis=0)
    sight = Sight(
        cmod=stations,
        time=stations / RATE / (1 + (amplitudes[0] if name == "cmod_gain" else 0)),
        points=points,
        side=np.sign(points[:, 0] + 1e-9),
        tip=np.array(BEAM.tip),
        peak_cmod=1e-4,
        centre=(low + high) / 2,
        corner=float(np.hypot(*(high - low)) / 2),
        pull=np.array([0.0, -1.0]),
        end_cmod=RATE * 60 * (1 + (amplitudes[0] if name == "cmod_gain" else 0)),
    )
    one = effect(name)
    field_at, load_at = (look(amplitudes, sight, stations) for look in (one.field_at, one.load_at))
    field = of.field.at(field_at / RATE).displacement
    reading = one.distort(amplitudes, sight, Reading(field, of.curve.load_at(load_at)))
    return reading.field, reading.load


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("fixture_compliance_um_per_kn", 25.0), ("magnification", 1.5e-3), ("lens_distortion", -0.01),
        ("load_gain", 0.07), ("cmod_gain", -0.08), ("sync_offset_s", 1.7), ("drift_um_per_min", 9.0),
    ],
)  # fmt: skip
def test_the_record_is_spoiled_as_the_diagnosis_believes(name, value):
    """Two codes, one meaning: engine B's record at the stations is what the effect of the library predicts."""
    clean = record()
    dirty = spoiled(clean, {name: value})
    amplitudes = np.array([value])
    if name == "drift_um_per_min":
        amplitudes = value * np.array([np.cos(clean.heading), np.sin(clean.heading)])
    field, load = diagnosed(clean, name, amplitudes)
    stations = RATE * np.array([12.0, 24.0, 36.0, 48.0])
    seen = dirty.field.at(dirty.curve.time_at(stations)).displacement
    assert np.allclose(dirty.curve.load_at(stations), load, rtol=2e-4)  # both interpolate a sine over 0.2 s
    assert np.allclose(seen, field, atol=2e-8)  # the load between two frames is taken as straight: 1 in 1000 of 25 µm


def test_all_measurement_effects_can_be_put_in():
    assert set(SPOILED) == {n for n, e in library().items() if e.kind == "measurement"}
    with pytest.raises(InputError, match="modulus"):
        spoiled(record(), {"modulus": 0.1})


def test_voids_take_their_share_of_the_mastic():
    rng = np.random.default_rng(0)
    phases = with_voids(one_phase, BEAM, 0.07, rng)
    x0, y0, x1, y1 = BEAM.bounds
    points = np.random.default_rng(1).uniform((x0, y0), (x1, y1), (20000, 2))
    share = np.mean(phases(points)[0] == Phase.VOID)
    assert share == pytest.approx(1 - np.exp(-0.07), abs=0.01)  # disks may overlap and reach out; 20000 darts: 0.002


def test_no_voids_no_change():
    assert with_voids(one_phase, BEAM, 0.0, np.random.default_rng(0)) is one_phase


def test_damaged_bonds_that_slide_have_walked_the_same_share_of_both_branches():
    law = MixedSoftening(*(np.full(2, v) for v in (1e8, 4e7, 200.0, 150.0, 1e-4, 8e-5)))
    hurt = walked(law, np.array([True, False]), 0.25)
    for k, f, end, k0, f0 in (
        (hurt.k_n, hurt.f_max, hurt.delta_max, 1e8, 200.0), (hurt.k_s, hurt.f_shear, hurt.delta_shear, 4e7, 150.0),
    ):  # fmt: skip
        assert np.allclose(f, [0.75 * f0, f0])
        assert k[1] == k0
        assert f[0] / k[0] == pytest.approx(f0 / k0 + 0.25 * (end[0] - f0 / k0))  # the place on the old branch


@pytest.mark.parametrize("names", [("creep", "rate_law_per_decade"), ("creep", "tip_damage")])
def test_what_the_network_cannot_do_is_refused(names):
    plan = Plan(BEAM, MIXTURE)
    for name in names:
        plan = effect(name).change(0.1, plan)
    with pytest.raises(UnavailableError, match="not in this version"):
        refuse_unknown(plan)
