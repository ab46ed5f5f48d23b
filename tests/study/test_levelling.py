"""Levelling: what the correlation leaves of a simulated field, and where its pictures lie."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.bundles import DELTA_MAX, F_MAX, coarse_experiment

from pipeline.config import run_settings
from pipeline.core.errors import InputError
from pipeline.core.field import rigid_residual
from pipeline.core.units import MM
from pipeline.dic.grid import Grid
from pipeline.dic.settings import Settings
from pipeline.dic.track import track
from pipeline.equilibrium.solve import solve
from pipeline.inverse.objective import Objective
from pipeline.store.bundle import read_bundle
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.study.assembly import build_model
from pipeline.study.levelling import Leveller, crop, refuse_unlevelled
from pipeline.study.observation import observe_solution
from pipeline.study.photography import Film, Sheet, camera_frame, view_of

STATIONS = np.array([0.03, 0.08, 0.13]) * MM
SETTINGS = Settings(grid_step_px=8, threads=1)
NOISE = 1.0  # grey values


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    raw = coarse_experiment("lattice").model_dump(exclude_none=True)
    raw["model"]["particle_radius_mm"] = 1.0
    raw["start"] = {"f_max_n": F_MAX / 2, "delta_max_m": DELTA_MAX}
    folder = tmp_path_factory.mktemp("bundles") / "lattice"
    write_bundle(folder, Experiment.model_validate(raw), Contents())
    return read_bundle(folder)


@pytest.fixture(scope="module")
def broken_lattice(bundle):
    """A test of the lattice itself: the problem, its solution, and what a camera of 0.1 mm/px measures of it."""
    problem = build_model(bundle).problem(F_MAX / 2, DELTA_MAX, frames=STATIONS, cmod_max=0.14 * MM)
    solution = solve(problem)
    shape, frame = camera_frame(problem.specimen, 0.1)
    film = Film(Sheet(problem, view_of(frame)), shape, solution.displacement, 1, NOISE)
    return problem, solution, film, list(track(film.pictures(np.random.default_rng(1)), SETTINGS))


def seen(levelled, film, found, points):
    """Residual (frames, p, 2) in px between measurement and simulation, without rigid motion; NaN where invalid."""
    view = film.sheet.view
    moved = [c.at(view.pixel(points)) for c in found]
    measured = np.array([view.vector(m) for m, _, _ in moved])
    both = np.array([v for _, _, v in moved]) & np.isfinite(levelled[..., 0])
    left = rigid_residual(points, np.nan_to_num(measured - levelled), both)
    return np.where(both[..., None], left, np.nan) / view.metre_per_px


def rms(values):
    return float(np.sqrt(np.nanmean(values**2)))


def near_points(film, problem):
    """Grid points of the picture within 4 mm of the ligament, 6 to 30 mm above the notch tip."""
    grid = film.sheet.view.point(Grid.over(film.shape, SETTINGS).points)
    use = (np.abs(grid[:, 0]) < 6 * MM) & (np.abs(grid[:, 1] - problem.specimen.tip[1] - 5 * MM) < 4 * MM)
    return grid[use]


def test_levelling_lowers_what_separates_a_lattice_from_its_own_pictures(broken_lattice, tmp_path):
    problem, solution, film, found = broken_lattice
    points = near_points(film, problem)
    leveller = Leveller(film.sheet.view, SETTINGS, points, tmp_path, "test")
    plain = seen(observe_solution(problem, solution, points), film, found, points)
    level = seen(leveller.seen(problem, solution), film, found, points)
    both = np.isfinite(plain) & np.isfinite(level)
    plain, level = np.where(both, plain, np.nan), np.where(both, level, np.nan)
    assert both.mean() > 0.95
    stated = rms(np.concatenate([c.std[c.valid] for c in found]))
    # noise of a pair, and beside the crack where another speckle lets another cut be found
    assert rms(level) < 1.8 * stated
    assert rms(level) < 0.5 * rms(plain)  # measured: 0.008 against 0.024 px
    assert rms(level[0]) == pytest.approx(rms(plain[0]), rel=0.1)  # before anything parts there is nothing to level


def test_levelled_fields_are_kept(broken_lattice, tmp_path):
    problem, solution, film, _ = broken_lattice
    points = near_points(film, problem)[::40]
    leveller = Leveller(film.sheet.view, SETTINGS, points, tmp_path, "test")
    first = leveller.seen(problem, solution)
    [path] = tmp_path.iterdir()
    made = path.stat().st_mtime_ns
    np.testing.assert_array_equal(leveller.seen(problem, solution), first)
    assert path.stat().st_mtime_ns == made
    path.write_bytes(b"cut short")
    np.testing.assert_array_equal(leveller.seen(problem, solution), first)  # levelled again, the same speckle
    other = Leveller(film.sheet.view, Settings(grid_step_px=8, subset_size_px=21, threads=1), points, tmp_path, "test")
    assert other.path(problem) != leveller.path(problem) == path


def test_the_part_that_is_photographed_is_in_step_with_the_whole(broken_lattice):
    _, _, film, _ = broken_lattice
    view, grid = film.sheet.view, Grid.over(film.shape, SETTINGS).points
    points = view.point(grid[(grid[:, 0] > 150) & (grid[:, 0] < 230) & (grid[:, 1] > 100) & (grid[:, 1] < 160)])
    part, shape = crop(view, points, SETTINGS)
    nodes = Grid.over(shape, SETTINGS).points
    at = part.pixel(points)
    np.testing.assert_allclose(at - np.rint(at), 0, atol=1e-6)  # whole pixels, to round-off in metres
    assert set(map(tuple, np.rint(at).astype(int))) <= set(map(tuple, nodes.astype(int)))
    assert at.min() > 3 * 25  # three subsets around
    assert np.all(np.array(shape[::-1]) - at.max(axis=0) > 3 * 25)


def test_nothing_is_torn_at_rest_but_the_notch(broken_lattice):
    problem, solution, film, _ = broken_lattice
    position = problem.particles.position
    torn = film.sheet.torn(np.zeros(position.shape))
    crossing = (position[torn[:, 0], 0] > 0) != (position[torn[:, 1], 0] > 0)
    inside = np.all(position[torn][..., 1] < problem.specimen.tip[1] + 2 * MM, axis=1)
    length = np.hypot(*(position[torn[:, 0]] - position[torn[:, 1]]).T)
    short = length < 3 * MM  # the others close the hull around the specimen
    assert np.all((crossing & inside)[short])
    assert len(film.sheet.torn(solution.displacement[-1])) > len(torn) + 5  # a crack has grown


@pytest.mark.parametrize(
    ("levelling", "aim", "told"),
    [
        (True, Objective.LOAD, "objective = load compares none"),
        (True, Objective.FIELDS, r"\[camera\] mm_per_px"),
        (False, Objective.FIELDS, None),
    ],
)
def test_levelling_is_obeyed_or_refused(bundle, levelling, aim, told):
    settings = run_settings({"levelling": levelling})
    if told is None:
        refuse_unlevelled(bundle, settings, aim)
        return
    with pytest.raises(InputError, match=told):
        refuse_unlevelled(bundle, settings, aim)
