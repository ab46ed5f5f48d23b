"""Bad input from the command line: one clear message, the right exit code, and nothing lost."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers.bundles import edit
from helpers.commands import run
from helpers.damage import cut_off, field, filled, folder_instead, labels, photograph, row_8, rows
from helpers.refusals import PARAMETERS, assert_refused, lines

# what is said of a key of experiment.toml, by every command alike
EDITS = [
    ({"thickness_mm": "-40.0"}, "[specimen] thickness_mm = -40.0 must be positive"),
    ({"thickness_mm": "nan"}, "[specimen] thickness_mm = nan must be a finite number"),
    ({"thickness_mm": "1" + 400 * "0"}, "[specimen] thickness_mm = 1000"),
    ({"thickness_mm": "1" + 5000 * "0"}, "experiment.toml is not valid TOML"),
    (
        {"notch_length_mm": "75.0"},
        "notch_length_mm = 75 reaches outside the specimen: it must be smaller than depth_mm",
    ),
    ({"notch_length_mm": "-1.0"}, "notch_length_mm = -1.0 must be positive"),
    ({"poissons_ratio": "0.33"}, "poissons_ratio = 0.33 in plane strain gives a negative shear stiffness"),
    ({"mastic_modulus_gpa": "1e4"}, "lies outside 0.001 to 1000 GPa"),
    ({"lattice_angle_deg": "1e300"}, "lattice_angle_deg = 1e+300 must be at most 360"),
    ({"columns_mm": "[]"}, "[observation] columns_mm = [] has too few entries"),
    ({"name": '"a; rm -rf /"'}, 'name = "a; rm -rf /" may hold letters'),
    ({"name": '"../../etc"'}, 'name = "../../etc" may hold letters'),
    ({"name": '"$(touch x)"'}, 'name = "$(touch x)" may hold letters'),
    ({"name": '".."'}, 'name = ".." may hold letters'),
    ({"name": '"-rf"'}, 'name = "-rf" may hold letters'),
    ({"name": r'"a\nb"'}, r'name = "a\nb" may hold letters'),
    ({"name": f'"{"a" * 1000}"'}, "is too long"),
]


@pytest.mark.parametrize("command", ["check", "identify"])
@pytest.mark.parametrize(("values", "told"), EDITS, ids=[told for _, told in EDITS])
def test_a_faulty_value_is_named_with_its_rule(bundle, command, values, told):
    edit(bundle, **values)
    assert_refused(bundle.parent, lines(command, bundle), told)
    assert not (bundle.parent / "out" / "simulations").exists()


def up_to_the_peak(table: list[str]) -> list[str]:
    loads = [float(row.split(",")[2]) for row in table[1:]]
    return table[: 2 + loads.index(max(loads))]


def wild(displacement: np.ndarray) -> np.ndarray:
    """The frames of the second half gone astray, but for the last."""
    frame = np.arange(len(displacement))
    return np.where(((frame > len(frame) // 2) & (frame < frame[-1]))[:, None, None], 1e300, displacement)


NOISE = np.clip(np.random.default_rng(0).normal(128, 5, (121, 275)), 0, 255).astype(np.uint8)
PLAIN = np.full((121, 275), 128, np.uint8)
FILES = {
    "label image cut off": (cut_off("labels.png", 200), "labels.png: is truncated"),
    "label image empty": (cut_off("labels.png", 0), "labels.png: is empty"),
    "label image of text": (filled("labels.png", b"not an image"), "labels.png: is neither PNG nor TIFF"),
    "label image of other values": (labels(5), "labels.png: holds the values 5"),
    "label image without material": (labels(0), "labels.png: the label image holds neither mastic"),
    "label image a folder": (folder_instead("labels.png"), "labels.png: is not a file"),
    "photograph without aggregate": (photograph(NOISE), "specimen.png: no aggregate can be told from the mastic"),
    "photograph blank": (photograph(PLAIN), "specimen.png: the photograph is blank"),
    "photograph of another format": (photograph(NOISE, "specimen.jpg"), "specimen.jpg: is not read"),
    "NaN in the record": (row_8(cmod="nan"), "load_cmod.csv: row 8: cmod_mm is nan"),
    "a word in the record": (row_8(load="abc"), "load_cmod.csv: row 8: load_n = 'abc' is not a number"),
    "an empty cell": (row_8(cmod=""), "load_cmod.csv: row 8: cmod_mm = '' is not a number"),
    "a huge load": (row_8(load="1e308"), "load_cmod.csv: load_n peaks at 1e+308"),
    "a record without rows": (rows(lambda table: table[:1]), "load_cmod.csv: has no rows below its header"),
    "a record backwards": (rows(lambda table: [table[0], *table[:0:-1]]), "times must increase"),
    "a record that is no text": (filled("load_cmod.csv", bytes(range(256))), "load_cmod.csv: is not UTF-8 text"),
    "a record that is a folder": (folder_instead("load_cmod.csv"), "load_cmod.csv: is not a file"),
    "settings not UTF-8": (filled("experiment.toml", b"# \xe4\xff"), "experiment.toml is not UTF-8 text"),
    "settings of zeros": (filled("experiment.toml", bytes(1000)), "experiment.toml is not valid TOML"),
    "settings nested": (filled("experiment.toml", b"a=" + 10**5 * b"["), "experiment.toml is not valid TOML"),
    "settings empty": (filled("experiment.toml", b""), "experiment.toml: specimen is missing: add it"),
    "settings a folder": (folder_instead("experiment.toml"), "experiment.toml cannot be read"),
    "settings missing": (lambda bundle: (bundle / "experiment.toml").unlink(), "experiment.toml is missing"),
    "fields cut off": (cut_off("fields.h5", 20_000), "fields.h5: it is truncated (20000 bytes)"),
    "fields of text": (filled("fields.h5", b"time"), "fields.h5: it is no readable HDF5 file"),
    "fields a folder": (folder_instead("fields.h5"), "fields.h5: is not a file"),
    "fields never valid": (field("valid", np.zeros_like), "valid in any frame"),
    "points without place": (field("points", lambda p: p * np.nan), "fields.h5: points holds NaN"),
    "points in metres": (field("points", lambda p: p / 1000), "fields.h5: points lie within 0.024 mm"),
    "fields in metres": (field("displacement", lambda u: u / 1000), "are these metres? displacement is in mm"),
    "fields at another time": (field("time_s", lambda t: t + 1e4), "do not overlap those of load_cmod.csv"),
}


@pytest.mark.parametrize("command", ["check", "identify"])
@pytest.mark.parametrize("case", FILES)
def test_a_faulty_file_is_named_with_its_remedy(bundle, command, case):
    damage, told = FILES[case]
    damage(bundle)
    assert_refused(bundle.parent, lines(command, bundle), told)
    assert not (bundle.parent / "out" / "simulations").exists()


@pytest.mark.parametrize("command", ["model", "simulate"])
@pytest.mark.parametrize("case", ["label image cut off", "photograph without aggregate", "settings missing"])
def test_other_commands_refuse_alike(bundle, command, case):
    damage, told = FILES[case]
    damage(bundle)
    assert_refused(bundle.parent, lines(command, bundle), told)


def test_all_that_is_wrong_is_listed_at_once(bundle):
    """Also what only the image's content forbids."""
    row_8(cmod="nan")(bundle)
    photograph(NOISE)(bundle)
    edit(bundle, shear_strength_ratio="0.5")
    told = ("row 8: cmod_mm is nan", "no aggregate can be told", "shear_strength_ratio = 0.5 cannot be identified")
    assert_refused(bundle.parent, lines("check", bundle), *told)


@pytest.mark.parametrize("command", ["check", "model", "simulate", "identify"])
@pytest.mark.parametrize(
    ("make", "told"),
    [
        (Path.mkdir, "experiment.toml is missing"),
        (Path.touch, "is not a folder"),
        (lambda path: None, "is not a folder"),
    ],
    ids=["empty folder", "file", "nothing"],
)
def test_what_is_no_bundle_is_refused(tmp_path, command, make, told):
    make(tmp_path / "bundle")
    assert_refused(tmp_path, lines(command, tmp_path / "bundle"), told)


# what can be foreseen is refused before the first simulation
HOPELESS = {
    "too soft a start": (partial(edit, delta_max_m="1e-8"), (), "must be larger than delta_peak"),
    "too strong a start": (partial(edit, f_max_n="1e7"), (), "raise delta_max or lower f_max"),
    "points off the fields": (partial(edit, columns_mm="[-90.0, 90.0]"), (), "asks for a point at (-90, 15) mm"),
    "one point": (partial(edit, columns_mm="[-4.5]", rows_mm="[0.0]"), (), "only 0 displacement vectors"),
    "end before the peak": (partial(edit, cmod_max_mm="0.05"), (), "[loading] cmod_max_mm = 0.05 ends the simulated"),
    "record ends at its peak": (rows(up_to_the_peak), (), "load_cmod.csv: the record ends at its peak"),
    "fields end before": (field("time_s", lambda t: t * 0.1), (), "only 0 displacement vectors"),
    "nothing but stone": (labels(2), (), "the specimen holds no bond of mastic or interface"),
    "a wild point": (field("displacement", wild), (), "mark it as not valid"),
    "fields without noise": (field("std_mm", np.zeros_like), ("--objective", "both"), "std_mm is zero"),
    "no fields": (lambda bundle: (bundle / "fields.h5").unlink(), ("--objective", "fields"), "fields.h5 is missing"),
    "no record": (lambda bundle: (bundle / "load_cmod.csv").unlink(), (), "load_cmod.csv is missing"),
    "other fields missing": (lambda bundle: None, ("--fields", "no.h5"), "no.h5 does not exist"),
    "other fields a folder": (lambda bundle: None, ("--fields", "."), "is not a file"),
    "grid too wide": (lambda bundle: None, ("--grid", "1,2,100"), "grid = 100.0: should be less than or equal to 10"),
    "grid too fine": (lambda bundle: None, ("--grid", "1e-9,1,2"), "must be larger than delta_peak"),
    "radius too large": (lambda bundle: None, ("--radius-mm", "8"), "particle_radius_mm = 8 is too large"),
    "radius too small": (lambda bundle: None, ("--radius-mm", "0.001"), "at most 5e+06 are taken"),
    "accuracy never reached": (lambda bundle: None, ("--accuracy", "1e-30"), "accuracy = 1e-30: should be"),
    "no such settings": (lambda bundle: None, ("--config", "no.toml"), "no.toml does not exist"),
    "settings a folder": (lambda bundle: None, ("--config", "."), "cannot be read as TOML"),
}


@pytest.mark.parametrize("case", HOPELESS)
def test_a_hopeless_search_is_refused_before_its_first_simulation(bundle, case):
    damage, options, told = HOPELESS[case]
    damage(bundle)
    assert_refused(bundle.parent, (*lines("identify", bundle), *options), told)
    simulations = bundle.parent / "out" / "simulations"
    assert not simulations.exists() or not list(simulations.iterdir())


USAGE = [
    ("--workers", "0"),
    ("--workers", "many"),
    ("--grid", ""),
    ("--grid", "0.9,1.1"),
    ("--grid", "1.1,1,0.9"),
    ("--grid", "0.9;1;1.1"),
    ("--grid", "-1,1,2"),
    ("--grid", "0.9,1,inf"),
    ("--radius-mm", "nan"),
    ("--accuracy", "0"),
    ("--seed", "-1"),
    ("--objective", "energy"),
    ("--no-such-option",),
]


@pytest.mark.parametrize("options", USAGE, ids=" ".join)
def test_wrong_usage_names_the_option_and_does_nothing(bundle, options):
    ended = run(*lines("identify", bundle), *options)
    assert (ended.exit_code, ended.stdout) == (2, "")
    assert options[0] in ended.stderr
    assert "Traceback" not in ended.stderr
    assert not (bundle.parent / "out").exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--f-max", "1e400"), ("--f-max", "1e9"), ("--delta-max", "0.114"), ("--delta-max", "1e-300")]
)
def test_parameters_beyond_every_material_are_wrong_usage(bundle, option, value):
    ended = run("simulate", bundle, "-o", bundle.parent / "out", *PARAMETERS, option, value)
    assert ended.exit_code == 2
    assert f"Invalid value for '{option}'" in ended.stderr


@pytest.mark.parametrize("command", ["simulate", "identify"])
def test_a_missing_compiled_style_is_told_before_any_work(bundle, monkeypatch, command):
    monkeypatch.setattr("pipeline.lmp.plugin.folder", lambda: str(bundle.parent / "nowhere"))
    told = "cohesiveplugin.so does not exist: install the package where a C++ compiler (g++) is found"
    assert_refused(bundle.parent, lines(command, bundle), told)
    assert not (bundle.parent / "out").exists()
