"""What is written as experiment.toml reads back the same, with every key explained."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.store.experiment import Experiment, parse_experiment
from pipeline.store.new import first_experiment
from pipeline.store.toml_text import toml_text, toml_value

NUMBER = st.floats(1.0, 900.0)


@st.composite
def experiments(draw) -> Experiment:
    """Settings with any mixture of optional tables and keys."""
    frame = {
        "mm_per_px": draw(st.floats(1e-4, 9)),
        "origin_px": [draw(st.floats(-1e4, 1e4)), draw(st.floats(-1e4, 1e4))],
        "mirror": draw(st.booleans()),
    }
    sizes = {
        "seb": {k: draw(NUMBER) for k in ("thickness_mm", "depth_mm", "span_mm", "length_mm", "notch_length_mm")},
        "dct": {"thickness_mm": draw(NUMBER), "diameter_mm": draw(NUMBER)},
    }
    geometry = draw(st.sampled_from(["seb", "dct"]))
    optional = {
        "camera": frame,
        "start": {"f_max_n": draw(st.floats(1e-3, 1e6)), "delta_max_m": draw(st.floats(1e-7, 1e-3))},
        "noise": {"load_std_n": draw(st.floats(1e-3, 1e3))},
        "observation": {"rows_mm": draw(st.lists(st.floats(-50, 50), min_size=1, max_size=5))},
    }
    chosen = draw(st.sets(st.sampled_from(sorted(optional))))
    specimen = {"geometry": geometry, **sizes[geometry]} | ({"image": frame} if draw(st.booleans()) else {})
    raw = {
        "format": 1,
        "name": draw(st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,19}", fullmatch=True)),
        "specimen": specimen,
        "loading": {"cmod_rate_mm_per_min": draw(st.floats(1e-3, 100))},
        "material": {"poissons_ratio": draw(st.floats(0, 0.49)), "plane": draw(st.sampled_from(["strain", "stress"]))},
        **{name: optional[name] for name in chosen},
    }
    return Experiment.model_validate(raw)


@settings(max_examples=40)
@given(experiments())
def test_write_then_read_is_the_identity(experiment):
    sections, problems = parse_experiment(tomllib.loads(toml_text(experiment)))
    assert problems == []
    assert Experiment.model_construct(**sections) == experiment


@pytest.mark.parametrize("geometry", ["seb", "dct"])
def test_commented_out_lines_are_valid_when_the_marks_are_taken_off(geometry):
    """Whoever takes off '# ' gets a file that is read: the examples are in order."""
    lines = toml_text(first_experiment(geometry, "x")).splitlines()
    text = "\n".join(line.removeprefix("# ") for line in lines[1:])
    raw = tomllib.loads(text)
    assert parse_experiment(raw)[1] == []
    assert raw["specimen"]["image"]["mm_per_px"] == 0.05
    assert raw["camera"]["origin_px"] == [1500.0, 1200.0]


def test_every_key_of_a_number_is_explained():
    lines = toml_text(first_experiment("seb", "x")).splitlines()
    bare = [line for line in lines if " = " in line and "# " not in line.removeprefix("# ")]
    assert bare == []


def test_values_are_written_as_toml():
    assert toml_value((1, 2.0, -3e-7)) == "[1, 2.0, -3e-07]"
    assert toml_value('a"b') == '"a\\"b"'
    assert toml_value(True) == "true"
