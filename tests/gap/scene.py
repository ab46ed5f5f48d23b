"""A made-up test: a hinge that opens, whose fields and loads are formulas; with everything a diagnosis needs."""

from __future__ import annotations

import numpy as np

from pipeline.gap.diagnosis import Run
from pipeline.gap.discrepancy import ALL, KNOTS, Discrepancy
from pipeline.gap.effects import effect
from pipeline.gap.library import Domain, Entry
from pipeline.gap.observation import Observation, Reading, Sight
from pipeline.gap.response import Abscissae, Response, read

PEAK = 0.05e-3
TIP = np.array([0.0, 15e-3])


def sight(columns=(-9.0, -4.5, 4.5, 9.0), rows=(0.0, 1.5, 3.0, 4.5)) -> Sight:
    """The paper's points and stations of SE(B)."""
    x, y = np.meshgrid(columns, rows)
    points = np.column_stack([x.ravel(), y.ravel()]) * 1e-3 + TIP
    cmod = np.concatenate([PEAK * np.array([0.25, 0.5, 0.75]), PEAK + 0.05e-3 * np.arange(10)])
    return Sight(
        cmod=cmod,
        time=cmod / (0.5e-3 / 60),
        points=points,
        side=np.sign(points[:, 0]),
        tip=TIP,
        peak_cmod=PEAK,
        centre=np.array([0.0, 20e-3]),
        corner=32e-3,
        pull=np.array([0.0, -1.0]),
        end_cmod=float(cmod[-1]),
    )


def response(parameters: np.ndarray, at: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Field (k, p, 2), m, and load (k,), N, of a hinge at the CMOD values `at` (k,).

    Two halves turn about a point that moves up with the opening; the load rises and falls. The first parameter scales
    the load and lifts the hinge a little, the second stretches the tail and lifts the hinge more.
    """
    strength, opening = parameters
    height = 45e-3 + 5e-3 * (strength - 1) + 12e-3 * np.tanh(at / (opening * 0.2e-3))
    turn = (at / 2) / height
    side = np.where(points[:, 0] >= 0, 1.0, -1.0)
    arm = height[:, None] - points[:, 1]
    field = np.stack([side * turn[:, None] * arm, side * turn[:, None] * points[:, 0]], axis=-1)
    load = 3000 * strength * (at / PEAK) * np.exp(1 - at / PEAK) * 0.7 + 900 * strength * (
        1 - np.exp(-at / PEAK)
    ) * np.exp(-at / (opening * 0.3e-3))
    return field, load


def discrepancy(level: float = 1.0) -> Discrepancy:
    """A few micrometres and per cent, as two engines differ."""
    amplitude = level * np.full((len(ALL), KNOTS.size), 2e-6)
    amplitude[-1] = level * 0.03
    return Discrepancy(amplitude, np.eye(len(ALL)), level * np.full(3, 0.5e-6), 0.4e-3, samples=20)


def observed(seen: Sight, reading: Reading, rng: np.random.Generator | None, noise: float = 0.4e-6) -> Observation:
    """A reading with white noise, none where there is no generator; 5 N of the load."""
    field, load = reading.field, reading.load
    if rng is not None:
        field = field + noise * rng.standard_normal(field.shape)
        load = load + 5.0 * rng.standard_normal(load.shape)
    return Observation(seen, Reading(field, load), np.full(field.shape[:2], noise), np.full(load.shape, 5.0))


START = (1.0, 1.0)
FRAMES = np.concatenate([PEAK * np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.3]), np.linspace(0.09e-3, 0.53e-3, 16)])
ABSCISSAE = Abscissae(FRAMES, np.linspace(0.004e-3, 0.54e-3, 160))
PHYSICS = {
    "modulus": lambda f, p, v, at, x: (f, p * (1 + 0.4 * v * np.exp(-at / 2e-4))),
    "notch_length_mm": lambda f, p, v, at, x: (f * (1 + 0.01 * v * (x[:, :1] > 0)), p * (1 - 0.03 * v)),
    "tip_damage": lambda f, p, v, at, x: (f * (1 + 0.02 * v * np.exp(-at / 1e-4))[:, None, None], p * (1 - 0.02 * v)),
}  # what three physics effects may look like here


def simulate(runs) -> list[Response | str]:
    """The hinge, with three effects that it can simulate."""
    found: list[Response | str] = []
    points = sight().points
    for run in runs:
        lacking = [name for name, _ in run.effects if name not in PHYSICS]
        if lacking:
            found.append(f"the hinge knows no {lacking[0]}")
            continue
        parameters = np.array([run.f_max, run.delta_max])
        field, _ = response(parameters, ABSCISSAE.field, points)
        _, load = response(parameters, ABSCISSAE.load, points)
        for name, value in run.effects:
            field, _ = PHYSICS[name](field, 0.0, value, ABSCISSAE.field, points)
            _, load = PHYSICS[name](0.0, load, value, ABSCISSAE.load, points)
        found.append(Response(field, load))
    return found


def entry(level: float = 1.0, temperature: float = 1.0) -> Entry:
    domain = Domain("seb", (0.3e-3, 1e-3), 0.51e-3, (0.1e-6, 1e-6))
    return Entry(domain, discrepancy(level), temperature, 0, {})


def measured(names=(), amplitudes=(), rng=None, level=1.0, truth=(1.03, 0.95), noise=0.4e-6) -> Observation:
    """A test with effects in it, left with a draw of the discrepancy where there is a generator."""
    seen = sight()
    physics = tuple((n, float(a)) for n, a in zip(names, amplitudes, strict=True) if n in PHYSICS)
    [simulated] = simulate([Run(*truth, physics)])
    reading = read(simulated, ABSCISSAE, seen.cmod, seen.cmod)
    chosen = [(n, a) for n, a in zip(names, amplitudes, strict=True) if n not in PHYSICS]
    if chosen:
        field_at = load_at = seen.cmod
        for name, value in chosen:
            field_at = effect(name).field_at(np.atleast_1d(value), seen, field_at)
            load_at = effect(name).load_at(np.atleast_1d(value), seen, load_at)
        reading = read(simulated, ABSCISSAE, field_at, load_at)
        for name, value in chosen:
            reading = effect(name).distort(np.atleast_1d(value), seen, reading)
    if rng is not None:
        cov = discrepancy(level).covariance(seen, float(np.max(reading.load)))
        wave = np.linalg.cholesky(cov + 1e-9 * np.diag(np.diag(cov))) @ rng.standard_normal(len(cov))
        cut = reading.field.size
        reading = Reading(reading.field + wave[:cut].reshape(reading.field.shape), reading.load + wave[cut:])
    return observed(seen, reading, rng, noise)
