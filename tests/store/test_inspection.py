"""Whatever lies in a bundle, reading ends with the bundle or with named problems, never with another error."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import BundleError, PipelineError
from pipeline.store.bundle import read_bundle
from pipeline.store.experiment import FILE, parse_experiment
from pipeline.store.inspection import cut
from pipeline.store.records import read_record

JUNK = st.one_of(
    st.booleans(),
    st.integers(-(10**9), 10**9),
    st.floats(),
    st.text(max_size=8),
    st.lists(st.floats() | st.text(max_size=3), max_size=4),
    st.dictionaries(st.text(max_size=6), st.integers(), max_size=2),
)
SPECIMEN = {"thickness_mm": 40.0, "depth_mm": 60.0, "span_mm": 130.0, "length_mm": 137.0, "notch_length_mm": 15.0}
RAW = {
    "format": 1,
    "name": "beam",
    "specimen": {"geometry": "seb", **SPECIMEN},
    "loading": {"cmod_rate_mm_per_min": 0.5},
    "material": {"mastic_modulus_gpa": 10.0, "poissons_ratio": 0.25},
    "start": {"f_max_n": 71.0, "delta_max_m": 1.14e-4},
    "observation": {"rows_mm": [0.0, 1.5], "cmod_count": 10},
}
PLACES = [(t,) for t in RAW] + [(t, k) for t, v in RAW.items() if isinstance(v, dict) for k in v]


@settings(max_examples=200)
@given(st.dictionaries(st.sampled_from(PLACES), JUNK, max_size=4))
def test_settings_of_any_kind_are_read_or_refused_in_sentences(changes):
    raw = json.loads(json.dumps(RAW))
    for place, junk in sorted(changes.items(), key=lambda item: -len(item[0])):
        target = raw if len(place) == 1 else raw[place[0]]
        target[place[-1]] = junk
    sections, problems = parse_experiment(raw)
    specimen, uncut = cut(sections.get("specimen"), raw.get("specimen"), problems)
    assert all(sentence.startswith(f"{FILE}: ") for sentence in problems + uncut)
    assert (specimen is None) == (("specimen" not in sections) or bool(uncut))


CELL = st.one_of(st.floats().map(str), st.integers().map(str), st.sampled_from(["", "nan", "x", "1,5", "µ", '"', "0"]))
TABLE = st.lists(st.lists(CELL, max_size=5).map(",".join), max_size=8).map("\n".join)

NUMBER = st.floats(-100, 100).map(lambda x: f"{x:.3g}") | st.sampled_from(["nan", "0"])
NUMBERS = st.lists(st.lists(NUMBER, min_size=3, max_size=3).map(",".join), min_size=3, max_size=12).map("\n".join)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(["load_cmod.csv", "creep.csv", "frames.csv", "fields.h5", "labels.png", "specimen.tif", FILE]),
    head=st.sampled_from([b"", b"time_s,cmod_mm,load_n\n", b"time_s,compliance_1_per_gpa\n", b"frame,time_s\n"]),
    body=TABLE.map(str.encode) | st.binary(max_size=200),
)
def test_files_of_any_content_are_read_or_refused_by_name(bundle_folder, name, head, body):
    path = bundle_folder / name
    before = path.read_bytes() if path.exists() else None
    path.write_bytes(head + body)
    problems = problems_of(bundle_folder)
    path.unlink() if before is None else path.write_bytes(before)
    assert problems is None or any(name in problem for problem in problems)


def problems_of(folder) -> tuple[str, ...] | None:
    """What is wrong with a bundle, None where nothing is."""
    try:
        read_bundle(folder, thorough=True)
    except BundleError as error:
        return error.problems
    return None


@settings(max_examples=200)
@given(st.sampled_from(["", "CMOD,Load,x\n", "Time [s],CMOD [mm],Load [kN]\n"]), TABLE | NUMBERS | st.text(max_size=80))
def test_records_of_any_content_are_read_or_refused_by_name(tmp_path_factory, head, body):
    path = tmp_path_factory.mktemp("record") / "machine.txt"
    path.write_text(head + body, encoding="utf-8")
    read = curve_or_refusal(path)
    if isinstance(read, str):
        assert "machine.txt" in read
    else:
        assert np.all(np.diff(read.time) > 0)
        assert np.isfinite([read.cmod, read.load]).all()


def curve_or_refusal(path) -> LoadCurve | str:
    """The curve of a record, or why it is refused."""
    try:
        return read_record(path, cmod_rate=1e-6).curve
    except PipelineError as error:
        return str(error)


@pytest.mark.parametrize("known", [[], ["experiment.toml: [specimen] thickness_mm = -40.0 must be positive"]])
def test_what_is_known_is_not_told_twice(known):
    specimen, problems = cut(None, {"geometry": "seb", **SPECIMEN, "thickness_mm": -40.0}, known)
    assert specimen is None
    assert len(problems) == 1 - len(known)
