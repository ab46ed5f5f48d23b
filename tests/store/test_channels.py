"""What titles and units of a machine's file mean."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.store.channels import find_channels, normalised
from pipeline.store.dialect import Block


def block(*header: tuple[str, ...]) -> Block:
    width = len(header[0])
    return Block(header, np.arange(4.0 * width).reshape(4, width), np.arange(4), 0, "utf-8", "comma", "point")


def found(*header: tuple[str, ...], **options) -> dict[str, tuple[int, str]]:
    channels = find_channels(block(*header), "r.csv", **options)
    return {role: (c.column, c.unit) for role, c in channels.items()}


@pytest.mark.parametrize(
    ("titles", "roles"),
    [
        (("time_s", "cmod_mm", "load_n", "load_line_mm"), "time cmod load load_line"),
        (("Time (s)", "CMOD (mm)", "Load (N)", "Stroke (mm)"), "time cmod load load_line"),
        (("Zeit [s]", "Rissöffnung [mm]", "Kraft [N]", "Traversenweg [mm]"), "time cmod load load_line"),
        (("t / s", "Clip gauge / mm", "F / N", "Weg / mm"), "time cmod load load_line"),
        (("Prüfzeit in s", "COD1 in mm", "Standardkraft in N", "Standardweg in mm"), "time cmod load load_line"),
        (("Elapsed time, s", "Crack Mouth Opening Displacement, mm", "Axial Force, N"), "time cmod load"),
        (("Load line displacement", "Displacement (clip gauge)", "Load"), "load_line cmod load"),
        (("cmod", "load_min", "load_max"), "cmod load_min load_max"),
        (("Axial Displacement", "Axial Load", "COD", "Running Time"), "load_line load cmod time"),
    ],
)
def test_titles_in_several_languages(titles, roles):
    assert set(find_channels(block(titles), "r.csv")) == set(roles.split())


def test_the_more_telling_title_wins():
    """'Displacement' alone would be the machine's; 'crack opening displacement' is the gauge's."""
    assert found(("Crack opening displacement", "Displacement", "Force")) == {
        "cmod": (0, "mm"),
        "load_line": (1, "mm"),
        "load": (2, "n"),
    }


@pytest.mark.parametrize(
    ("title", "factor"),
    [
        ("Load [kN]", 1e3), ("Load (N)", 1), ("Load / kN", 1e3), ("load_kn", 1e3), ("Load, lbf", 4.4482216152605),
        ("Load in daN", 10), ("Load kN", 1e3), ("Load", 1), ("Load [kN] ", 1e3), ("Load<kN>", 1e3), ("LOAD_N", 1),
    ],
)  # fmt: skip
def test_units_stand_behind_titles_in_many_ways(title, factor):
    load = find_channels(block(("cmod", title)), "r.csv")["load"]
    assert np.array_equal(load.values, np.array([1.0, 3, 5, 7]) * factor)
    assert load.assumed == (title == "Load")


@pytest.mark.parametrize(
    ("unit", "factor"), [("mm", 1e-3), ("µm", 1e-6), ("um", 1e-6), ("μm", 1e-6), ("m", 1), ("in", 0.0254), ("cm", 1e-2)]
)
def test_lengths(unit, factor):
    assert find_channels(block((f"CMOD [{unit}]", "Load")), "r.csv")["cmod"].values[1] == 2 * factor


def test_a_row_of_units_counts_where_the_title_has_none():
    rows = (("Zeit", "COD", "Kraft"), ("s", "µm", "kN"))
    assert found(*rows) == {"time": (0, "s"), "cmod": (1, "um"), "load": (2, "kn")}
    assert found(("[s]", "[µm]", "[kN]"), rows[0]) == found(*rows)
    assert found(("", "µm", ""), rows[0])["cmod"] == (1, "um")


def test_min_behind_load_is_no_minute():
    assert found(("cmod", "load_min", "load_max"))["load_min"] == (1, "n")
    assert found(("Time [min]", "cmod", "Load"))["time"] == (0, "min")
    assert found(("time_min", "cmod", "Load"))["time"] == (0, "min")


def test_the_user_may_name_columns_and_units():
    titles = ("A", "B", "C [kN]")
    assert found(titles, columns={"time": 1, "cmod": "2", "load": "c"}, units={"cmod": "µm"}) == {
        "time": (0, "s"),
        "cmod": (1, "um"),
        "load": (2, "kn"),
    }
    assert found(("COD1", "COD2", "Load"), columns={"cmod": "COD2"})["cmod"] == (1, "mm")


@pytest.mark.parametrize(
    ("titles", "options", "sentence"),
    [
        (("CMOD", "Load 1", "Load 2"), {}, "the columns 'Load 1' and 'Load 2' could both be load: say which"),
        (("CMOD", "Load"), {"columns": {"time": 3}}, "has no column 3 for time: they are counted 1 to 2"),
        (("CMOD", "Load"), {"columns": {"time": "Zeit"}}, "no single column is called 'Zeit' (time): there are 'CMOD'"),
        (("CMOD", "Load"), {"columns": {"force": 1}}, "force is no column of a record"),
        (("CMOD", "Load"), {"units": {"load": "stone"}}, "is in 'stone', known are n"),
        (("CMOD [kN]", "Load"), {}, "column 'CMOD' (cmod) is in 'kn', known are mm"),
    ],
)
def test_what_is_not_clear_is_asked(titles, options, sentence):
    with pytest.raises(InputError) as error:
        find_channels(block(titles), "r.csv", **options)
    assert sentence in str(error.value)


def test_titles_are_compared_without_accents_and_case():
    assert normalised("  Prüf-Kraft  [µm] ß ") == "pruf kraft um ss"
