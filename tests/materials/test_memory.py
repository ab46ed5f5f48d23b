"""A step whose end is sought gives the forces of the bonds that are then brought there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import UnavailableError
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.memory import Memory, at_rest
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.relaxation import Arms
from pipeline.materials.softening import LINEAR, Shape, Softening, Unloading
from pipeline.materials.trial import CentralTrial

PEAK = 2e-7  # m
END = 60 * PEAK
one = np.ones(1)
ARMS = Arms(np.array([[3e8, 0.8e8]]), np.array([[2.0, 40.0]]), 0.2e8 * one)
LAWS = {
    "central": lambda unloading: CentralSoftening(4e8 * one, 80 * one, END * one, LINEAR, unloading),
    "mixed": lambda unloading: MixedSoftening(
        4e8 * one, 1e8 * one, 80 * one, 60 * one, END * one, 2 * END * one, LINEAR, unloading
    ),
    "creeping": lambda unloading: CreepingSoftening(ARMS, 80 * one, END * one, LINEAR, unloading),
}
walks = st.lists(
    st.tuples(st.floats(-2, 70), st.floats(-70, 70), st.sampled_from([0.0, 0.3, 5.0])), min_size=1, max_size=5
)


def deformation(law: str, opening: float, sliding: float) -> np.ndarray:
    return PEAK * (np.array([opening, sliding]) if law == "mixed" else np.array([opening]))


def carried(law: str, memory: Memory) -> np.ndarray:
    return np.append(memory.tension, memory.shear) if law == "mixed" else memory.tension


@pytest.mark.parametrize("unloading", list(Unloading))
@pytest.mark.parametrize("name", LAWS)
@given(walk=walks)
def test_trial_forces_are_those_of_the_settled_bonds(name: str, unloading: Unloading, walk: list) -> None:
    memory = at_rest(LAWS[name](unloading))
    for opening, sliding, duration in walk:
        trial, at = memory.trial(duration), deformation(name, opening, sliding)
        after = memory.settled(at, duration)
        assert trial.force(at) == pytest.approx(carried(name, after), rel=1e-9, abs=1e-9)  # round-off of sums
        assert np.all(trial.secant(at) >= 0)
        assert np.all(trial.secant(at) <= 4e8 * (1 + 1e-9))  # K(0): what is stiffer would stall the minimiser
        memory = after


@pytest.mark.parametrize("unloading", list(Unloading))
@pytest.mark.parametrize("shape", list(Shape))
@given(reached=st.floats(0, 70), opening=st.floats(-2, 250))
def test_central_trials_ask_the_law_only_where_it_falls(
    shape: Shape, unloading: Unloading, reached: float, opening: float
) -> None:
    f_max = np.array([80, np.inf])  # the second takes no damage
    law = CentralSoftening(4e8 * np.ones(2), f_max, END * np.ones(2), Softening(shape), unloading)
    seen, at = PEAK * reached * np.ones(2), PEAK * opening * np.ones(2)
    force = CentralTrial(law, seen).force(at)
    assert force == pytest.approx(law.force(at, seen), rel=1e-9, abs=1e-10)  # round-off of 80 N


def test_the_first_step_measures_by_the_elastic_stiffness() -> None:
    """Undamaged, force = elastic × deformation, and so is the secant; a creeping bond is stiffest in no time."""
    for name, law in LAWS.items():
        trial, at = at_rest(law(Unloading.SECANT)).trial(0.0), deformation(name, 0.5, 0.3)
        assert trial.force(at) == pytest.approx(trial.elastic * at, rel=1e-12)  # round-off
        assert trial.secant(at) == pytest.approx(trial.elastic, rel=1e-12)
        assert not trial.softening(at).any()
    slow = at_rest(LAWS["creeping"](Unloading.SECANT)).trial(5.0)
    assert 0.2e8 < slow.elastic[0] < 4e8


def test_softening_is_where_the_force_falls() -> None:
    """By differences along the opening, on the branch and while unloading."""
    for name, law in LAWS.items():
        memory = at_rest(law(Unloading.SECANT)).settled(deformation(name, 20, 0), 0.3)
        trial = memory.trial(0.3)
        for opening, expected in ((10, False), (30, True)):
            low, high = (trial.force(deformation(name, opening + d, 0))[0] for d in (0, 0.1))
            assert trial.softening(deformation(name, opening, 0))[0] == expected == (high < low)


def test_a_law_that_nobody_knows_is_refused() -> None:
    class Odd:
        k_n = one

    with pytest.raises(UnavailableError, match="what bonds with the law Odd remember"):
        at_rest(Odd())
