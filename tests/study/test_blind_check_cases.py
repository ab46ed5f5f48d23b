"""What a blind check consists of: its cases, the sizes of their effects, what tests of one specimen share."""

from __future__ import annotations

import json

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.execution.progress import Silent
from pipeline.gap.effects import library
from pipeline.study.blind_check import cases as drawing
from pipeline.study.blind_check.limits import library_digest, limits_of
from pipeline.study.blind_check.looks import Look, strips
from pipeline.study.blind_check.make import _broken_all, kept
from pipeline.study.blind_check.recording import taken
from pipeline.study.blind_check.seal import digest

EFFECTS = sorted(library())
LIMITS = limits_of(None, "seb", 1.0)


def test_the_cases_of_a_full_check():
    found = drawing.drawn_cases("full", LIMITS.value, np.random.default_rng(0))
    assert sum(c.images for c in found) * 5 >= len(found)
    for name in EFFECTS:
        limit, size = LIMITS.value[name], library()[name].magnitude
        mine = [c for c in found if c.kind == "effect" and list(c.effects) == [name]]
        together = [c for c in mine if c.replicates]
        assert [c.specimen for c in sorted(together, key=lambda c: c.specimen)] == [0, 1, 2, 3]
        assert len({(c.effects[name], c.noise, tuple(c.without)) for c in together}) == 1
        sizes = {abs(c.effects[name]) for c in mine}
        wanted = {min(m * limit, size.high) for m in (0.5, 1, 2, 4)}
        assert sorted(sizes) == pytest.approx(sorted(wanted), rel=5e-3)  # three digits
        assert all(
            sum(abs(c.effects[name]) == x and c.noise == n for c in mine) >= 1 for x in sizes for n in drawing.NOISE
        )
        assert all(size.low <= c.effects[name] <= size.high for c in mine)
        assert sum(c.kind == "outside" and name in c.effects and name in c.without for c in found) == 1
    assert all(not set(c.effects) & set(c.without) for c in found if c.kind != "outside")
    assert sum(c.kind == "none" and bool(c.without) for c in found) > 0  # a short library betrays nothing
    assert {len(c.without) for c in found} == {0, 3}  # one more name where something is hidden would betray it
    free = [c for c in found if c.kind == "none"]
    assert len(free) == 24
    assert len({(c.specimen, c.noise, bool(c.without)) for c in free}) == 24
    for label in {c.replicates for c in found} - {""}:
        assert len({(tuple(c.effects.items()), c.without) for c in found if c.replicates == label}) == 1
    assert len({c.replicates for c in free}) == 6
    assert {c.specimen for c in found if c.kind == "none"} == set(range(6))
    assert sum(c.stranger is not None for c in found) >= 10
    for case in (c for c in found if c.kind == "pair"):
        assert all(LIMITS.value[n] <= library()[n].magnitude.high for n in case.effects)


def test_the_small_check_has_twelve_cases():
    found = drawing.drawn_cases("small", LIMITS.value, np.random.default_rng(1))
    assert len(found) == 12
    assert sum(c.images for c in found) == 3
    assert {c.kind for c in found} == {"none", "effect", "pair", "outside"}


def test_detection_limits_of_a_diagnosis_scale_the_effects(tmp_path):
    file = tmp_path / "result.json"
    rows = {"load_gain": {"value": 0.01, "d_prime_at_most": 45.0}, "creep": {"value": None, "d_prime_at_most": 1.5}}
    file.write_text(json.dumps({"detection_limit": rows}))
    found = limits_of(file, "seb", 1.0)
    limits = found.value
    assert limits["load_gain"] == 0.01
    assert limits["creep"] == pytest.approx(2.0 * 3.0 / 1.5)  # d′ = 3 at twice the plausible maximum of 2
    assert limits["modulus"] == np.inf  # not judged
    assert found.told()["limits"]["modulus"] is None
    assert found.source["file_sha256"] == digest(file.read_bytes())
    assert drawing.sized("load_gain", 4.0, limits, -1.0) == pytest.approx((-0.04, 4.0))
    assert drawing.sized("load_gain", 40.0, limits, 1.0) == pytest.approx((0.15, 15.0))  # capped
    assert drawing.sized("creep", 0.5, limits, 1.0) == pytest.approx((2.0, 0.5))
    assert drawing.sized("modulus", 0.5, limits, -1.0) == (-0.5, 0.0)
    with pytest.raises(InputError, match="holds no detection limits"):
        limits_of(tmp_path, "seb", 1.0)


def test_the_limits_that_ship_are_of_the_nearest_radius_and_say_whose_they_are():
    assert limits_of(None, "seb", 0.9).source["radius_mm"] == 1.0
    told = LIMITS.told()
    assert told["of"] == "effect-free tests of engine B"
    assert told["by_library_in_use"] is (told["library_sha256"] == library_digest())
    assert set(told["limits"]) == set(EFFECTS)
    assert all(x is None or x > 0 for x in told["limits"].values())
    with pytest.raises(InputError, match="holds no detection limits of dct"):
        limits_of(None, "dct", 1.0)


def test_tests_of_one_specimen_share_the_path_that_most_are_near_to():
    line = np.array([[0.0, 15e-3], [0.0, 40e-3]])

    def look(name: str, shift_mm: float | None, peak: float = 50e-6, model: str = "m") -> Look:
        path = None if shift_mm is None else line + np.array([shift_mm * 1e-3, 0.0])
        return Look(name, model, path, peak, 0.5e-3)

    looks = [look("a", -1.5), look("b", 0.0), look("c", 1.5), look("d", 4.0, 75e-6), look("e", None, 40e-6),
             look("f", 0.0, model="n")]  # fmt: skip
    found = strips(looks)
    assert strips(looks[::-1]) == found  # whatever is looked at first
    assert found["a"] == found["b"] == found["c"]  # a and c are farther apart than that, but both near to b
    assert found["a"]["path_m"] == line.tolist()
    assert found["d"]["path_m"][0][0] == pytest.approx(4e-3)
    assert found["d"]["peak_m"] == 75e-6  # 1.5 times the others'
    assert found["e"]["path_m"] is None
    assert found["e"]["peak_m"] == 50e-6
    assert found["f"] == {"path_m": line.tolist(), "peak_m": 50e-6, "last_m": 0.5e-3}


def test_frames_are_closer_where_the_load_rises_and_falls():
    times = taken(60.0, 40)
    assert times.size == 44
    assert (np.diff(times) > 0).all()
    assert times[-1] - times[3] == pytest.approx(60.0)  # the first four at rest
    assert np.count_nonzero(times[4:] - times[3] <= 18.0 + 1e-9) == 24


def test_a_set_with_one_member_left_is_a_test_like_any_other():
    found = drawing.drawn_cases("full", LIMITS.value, np.random.default_rng(1))
    one, two = sorted({c.replicates for c in found} - {""})[:2]
    short = [c for c in found if c.replicates != one] + [c for c in found if c.replicates == one][:1]
    left = kept(short)
    assert [c.name for c in left] == [c.name for c in short]
    assert one not in {c.replicates for c in left}
    assert sum(c.replicates == two for c in left) == 4


class Breaking:
    """Stands for a job of which some tests cannot be broken."""

    def __init__(self, count: int, brittle: set[str]):
        self.names, self.brittle = [f"case-{k}" for k in range(count)], brittle

    def cases(self) -> list[str]:
        return self.names

    def write(self, names) -> list[str]:
        if self.brittle & set(names):
            raise ConvergenceError("the test snaps back")
        return list(names)


def test_few_tests_that_cannot_be_broken_are_left_out_and_said():
    job = Breaking(20, {"case-3"})
    groups = [job.names[k : k + 2] for k in range(0, 20, 2)]
    assert _broken_all(job, groups, 1, Silent()) == dict.fromkeys(("case-2", "case-3"), "the test snaps back")
    with pytest.raises(ConvergenceError, match="4 tests cannot be broken, more than 10%; take another seed"):
        _broken_all(Breaking(20, {"case-3", "case-9"}), groups, 1, Silent())
