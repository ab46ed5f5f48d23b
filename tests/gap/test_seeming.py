"""Effects that specimens seem to have, in worlds in which it is known how large they seem."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.gap.seeming import Seeming, apparent


def specimens(count: int, true: dict[str, float], rng: np.random.Generator, n: int = 40) -> list[Seeming]:
    """Three effects, the second nearly twice the first; noise of one and apparent values of the given scatter."""
    found = []
    for _ in range(count):
        columns = {"a": rng.standard_normal(n)}
        columns |= {"b": 2 * columns["a"] + 0.2 * rng.standard_normal(n), "c": rng.standard_normal(n)}
        left = rng.standard_normal(n) + sum(s * rng.standard_normal() * columns[name] for name, s in true.items())
        found.append(Seeming(left, columns))
    return found


def test_the_scatter_of_apparent_effects_is_found_and_its_imitators_are_left_out():
    found = apparent(specimens(400, {"a": 0.5}, np.random.default_rng(0)))
    assert list(found) in (["a"], ["b"])
    # 400 values, each to within 1/√40: 5 %, twice that allowed
    assert found.get("a", 2 * found.get("b", 0.0)) == pytest.approx(0.5, rel=0.1)


def test_two_that_differ_are_both_found():
    found = apparent(specimens(200, {"a": 0.5, "c": 0.8}, np.random.default_rng(1)))
    assert found["c"] == pytest.approx(0.8, rel=0.15)
    assert len(found) == 2


def test_what_is_known_beforehand_is_kept_and_explains_its_imitators():
    some = specimens(200, {"a": 0.5}, np.random.default_rng(3))
    assert apparent(some, {"a": 0.5}) == {"a": 0.5}
    assert apparent(some, {"a": 0.1})["a"] == pytest.approx(0.5, rel=0.15)  # two hundred values: 5 %, thrice that


def test_nothing_is_seen_in_noise():
    for seed in range(5):
        assert apparent(specimens(20, {}, np.random.default_rng(seed))) == {}


def test_an_effect_that_one_specimen_lacks_counts_in_the_others():
    some = specimens(200, {"c": 0.8}, np.random.default_rng(2))
    some[::2] = [Seeming(one.left - 0.0, {n: x for n, x in one.effects.items() if n != "c"}) for one in some[::2]]
    assert apparent(some[1::2])["c"] == pytest.approx(0.8, rel=0.2)  # a hundred values: 7 %
    assert "c" in apparent(some)
