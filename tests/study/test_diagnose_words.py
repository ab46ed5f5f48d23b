"""What the report of a diagnosis tells whoever has to act."""

from __future__ import annotations

from typing import Any

from pipeline.study.diagnose_words import (
    amount,
    closure_row,
    likely,
    next_section,
    percent,
    verdict_section,
    where_told,
)


def share(fraction: float | None) -> dict[str, Any]:
    interval = None if fraction is None else [fraction - 0.1, fraction + 0.1]
    return {"fraction": fraction, "interval_95": interval, "nothing_to_close": fraction is None}


def result(**changed: Any) -> dict[str, Any]:
    before = {"f_max_n": 100.0, "delta_max_m": 1e-4, "bond_fracture_energy_j_per_m2": 300.0}
    closed = {
        **share(0.9),
        "channels": {"field": share(0.92), "load": share(None)},
        "before": {"displacement_um": 42.0, "load_n": 223.0},
        "after": {"displacement_um": 7.0, "load_n": 83.0},
    }
    return {
        "verdict": "cause",
        "named": ["load_gain"],
        "reason": "load_gain has probability 0.90",
        "probability": {"load_gain": 0.9, "none": 0.05, "modulus": 0.02, "air_voids": 0.02},
        "log_bayes": {"load_gain": 9.0, "none": 0.0, "modulus": 0.1, "air_voids": -0.2, "cmod_gain + load_gain": 8.0},
        "set_90": ["load_gain", "none", "modulus", "air_voids"],
        "estimate": {"load_gain": {"value": 0.06, "unit": "1", "interval_95": [0.04, 0.08]}},
        "parameters_before": before,
        "parameters_after": before | {"f_max_n": 80.0, "interval_95": {"f_max_n": [70.0, 90.0]}},
        "bias_removed": {"f_max": 0.25, "delta_max": 0.0, "bond_fracture_energy": 0.25},
        "closure": {"load_gain": closed},
        "separate_by": ["load_gain: weigh it", "modulus: measure it"],
        "cannot_exclude": ["modulus"],
    } | changed


def test_the_verdict_names_cause_size_closure_and_remedy():
    found = verdict_section(result(), ["a remark"])
    assert found.text.startswith("Cause: the load cell reads too much (load_gain). load_gain has probability 0.90.")
    assert "closes 90% of the gap on data not used for it" in found.text
    joint = verdict_section(result(transfer=[]), [])
    assert "closes 90% of the gap on tests that it was not fitted to" in joint.text
    assert "To check: weigh it." in found.text
    assert "1 effect cannot be excluded" in found.text
    rows = {n.name: (n.value, n.remark) for n in found.numbers}
    assert rows["load_gain"] == ("0.06", "95 %: 0.04 to 0.08, if it is the only one")
    assert rows["f_max"] == ("80 N", "95 %: 70 to 90; 100 N (+25%) where nothing is added to the model")


def test_none_and_outside_say_what_they_mean():
    none = verdict_section(result(verdict="none needed", named=[], reason="because"), [])
    assert none.text.startswith("None needed: test and model part by no more than honest models")
    assert "To check" not in none.text
    lost = verdict_section(result(verdict="outside the library", named=[], reason="because"), [])
    assert "no known effect explains" in lost.text


def test_effects_of_which_the_data_say_nothing_are_only_counted():
    rows = likely(result())
    assert [r.name for r in rows] == ["load_gain", "model as it is", "2 others"]
    assert rows[-1].value == "0.04"
    told = next_section(result())
    assert told.text == "To confirm or to tell apart: load_gain: weigh it."
    assert told.notes == ["to see what these data hide – modulus: measure it"]


def test_closure_stands_in_micrometres_and_newtons_by_channel():
    row = closure_row("load_gain", result()["closure"]["load_gain"])
    assert row.value == "90%"
    assert row.remark == "95 %: 80% to 100%; field 42 → 7 µm (92%); load 223 → 83 N (nothing to close)"


def test_sizes_have_units_but_ratios_none():
    assert [amount(0.5, "1"), amount(3.0, "mm"), amount(None, "mm")] == ["0.5", "3 mm", "–"]


def test_shares_of_next_to_nothing_are_cut():
    assert [percent(x) for x in (0.987, -0.5, 12.0, -9.3)] == ["99%", "-50%", ">200%", "<-200%"]


def test_the_cells_that_stand_out_are_told_in_words():
    cell = {"stage": "tail", "rms": 123.4, "z_gap": 2.34, "z_noise": 15.6}
    field = {"channel": "field", "region": "tip", "mode": "opening", **cell}
    load = {"channel": "load", "region": "all", "mode": "all", **cell}
    told = where_told([field, load])
    assert "field, tail, tip, opening: 123 µm, 2.3 times what complete models leave, 16 times noise" in told
    assert "load, tail: 123 N" in told
