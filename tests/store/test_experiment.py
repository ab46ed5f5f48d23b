"""experiment.toml against bundle.md: keys, defaults, units, refusals."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import BundleError, InputError, MissingFileError
from pipeline.core.problem import Kinematics
from pipeline.core.specimen import DiskCompactTension
from pipeline.store.experiment import parse_experiment, read_experiment

EVERY_KEY = """\
format = 1
name = "seb-07"
[specimen]
geometry = "seb"
thickness_mm = 40.0
depth_mm = 60.0
span_mm = 130.0
length_mm = 137.0
notch_length_mm = 15.0
notch_width_mm = 0.0
gauge_length_mm = 4.0
gauge_y_mm = 0.0
[specimen.image]
mm_per_px = 0.05
origin_px = [1500.0, 1200.0]
rotation_deg = 0.0
mirror = true
[loading]
cmod_rate_mm_per_min = 0.5
temperature_c = -12.0
cmod_max_mm = 0.55
[camera]
mm_per_px = 0.0439
origin_px = [650.0, 990.0]
rotation_deg = 0.0
[dic]
subset_size_px = 25
grid_step_px = 6
roi_px = [0, 0, 1300, 1000]
sync_offset_s = 0.0
[noise]
displacement_std_mm = 0.0002
load_std_n = 5.0
[material]
mastic_modulus_gpa = 10.0
aggregate_modulus_gpa = 50.0
poissons_ratio = 0.25
plane = "strain"
interface_strength_ratio = 0.95
interface_opening_ratio = 0.30
aggregate_strength_ratio = 3.0
aggregate_opening_ratio = 1.0
aggregate_follows = false
shear_strength_ratio = 1.0
shear_opening_ratio = 1.0
softening = "linear"
unloading = "secant"
tensile_strength_mpa = 4.0
fracture_energy_j_per_m2 = 230.0
conversion = "contact-area"
touching = "interface"
[model]
particle_radius_mm = 0.3
kinematics = "small"
lattice_angle_deg = 90.0
[start]
f_max_n = 71.0
delta_max_m = 1.14e-4
[observation]
columns_mm = [-9.0, -4.5, 4.5, 9.0]
rows_mm = [0.0, 1.5, 3.0, 4.5]
cmod_count = 10
cmod_step_mm = 0.05
"""


def read(tmp_path: Path, text: str):
    path = tmp_path / "experiment.toml"
    path.write_text(text)
    return read_experiment(path)


def refused(text: str) -> list[str]:
    return parse_experiment(tomllib.loads(text))[1]


def test_reads_every_key_of_the_contract_into_si(tmp_path):
    experiment = read(tmp_path, EVERY_KEY)
    assert experiment.specimen.specimen().depth == 0.06
    assert experiment.loading.cmod_rate == 0.5e-3 / 60
    assert experiment.loading.cmod_max == pytest.approx(0.55e-3, rel=1e-15)  # one rounding of a product
    assert experiment.noise.displacement_std == pytest.approx(2e-7, rel=1e-15)  # one rounding of a product
    assert experiment.material.mastic_modulus == 10e9
    assert experiment.material.tensile_strength == 4e6
    assert experiment.model.radius == pytest.approx(3e-4, rel=1e-15)  # one rounding of a product
    assert experiment.model.lattice_angle == np.pi / 2
    assert experiment.model.motion is Kinematics.SMALL
    assert experiment.observation.cmod_step == pytest.approx(5e-5, rel=1e-15)  # one rounding of a product


def test_what_is_optional_has_the_values_of_the_contract(tmp_path, toml):
    """The full example shows the defaults: all optional sections left out give the same."""
    short, full = read(tmp_path, toml), read(tmp_path, EVERY_KEY)
    assert short.model == full.model
    assert short.observation == full.observation
    ratios = {"tensile_strength_mpa", "fracture_energy_j_per_m2"}
    assert short.material.model_dump(exclude=ratios) == full.material.model_dump(exclude=ratios)
    assert (short.dic.subset_size_px, short.dic.grid_step_px) == (25, 6)
    assert short.camera is None
    assert short.loading.cmod_max is None


def test_observation_points_of_the_paper_lie_ahead_of_the_tip(tmp_path, toml, beam):
    points = read(tmp_path, toml).observation.points(beam)
    assert points.shape == (16, 2)
    assert np.allclose(points[0], [-0.009, 0.015], rtol=0, atol=1e-15)  # metres: rounding of products
    assert np.allclose(points[-1], [0.009, 0.0195], rtol=0, atol=1e-15)  # metres: rounding of products


def test_a_disk_has_the_sizes_of_the_standard(tmp_path, toml):
    head, tail = toml.split("[specimen]")
    disk = read(
        tmp_path, head + '[specimen]\ngeometry = "dct"\nthickness_mm = 50.0\n[loading]' + tail.split("[loading]")[1]
    ).specimen.specimen()
    assert isinstance(disk, DiskCompactTension)
    assert disk == DiskCompactTension(0.15, 0.11, 0.035, 0.05, 0.0275, 0.0, 0.025, 0.05)


@pytest.mark.parametrize(
    ("line", "by", "sentence"),
    [
        ("depth_mm = 60.0", "", "[specimen] depth_mm is missing"),
        ("depth_mm = 60.0", "dept_mm = 60.0", "did you mean depth_mm?"),
        ("thickness_mm = 40.0", "thickness_mm = -40.0", "[specimen] thickness_mm = -40.0 must be positive"),
        ("thickness_mm = 40.0", "thickness_mm = 0.04", "thickness_mm = 0.04 lies outside 1 to 5000 mm"),
        ("thickness_mm = 40.0", 'thickness_mm = "40"', 'thickness_mm = "40" must be a number'),
        ("thickness_mm = 40.0", "thickness_mm = true", "thickness_mm = true must be a number"),
        ("thickness_mm = 40.0", "thickness_mm = nan", "thickness_mm = nan must be a finite number"),
        ('name = "beam-1"', 'name = "beam 1"', 'name = "beam 1" may hold letters'),
        ('name = "beam-1"', 'name = "beam/../1"', "may hold letters"),
        ('name = "beam-1"', 'name = ""', "may hold letters"),
        ("format = 1", "format = 2", "format = 2 must be 1"),
        ('geometry = "seb"', 'geometry = "ct"', 'geometry must be "seb" or "dct", not "ct"'),
        ("mastic_modulus_gpa = 10.0", "mastic_modulus_gpa = 10000.0", "the key asks for GPa"),
        ("mastic_modulus_gpa = 10.0", "poissons_ratio = 0.5", "poissons_ratio = 0.5 must be smaller than 0.5"),
        ("mastic_modulus_gpa = 10.0", 'plane = "plain"', "plane = \"plain\" must be 'strain' or 'stress'"),
        ("delta_max_m = 1.14e-4", "delta_max_m = 0.114", "the key asks for m"),
        ("delta_max_m = 1.14e-4", "", "[start] delta_max_m is missing"),
        ("[start]", "[dic]\nsubset_size_px = 24\n[start]", "subset_size_px = 24 must be odd"),
        ("[start]", "[observation]\nrows_mm = []\n[start]", "rows_mm = [] has too few entries"),
        ("[start]", "[camera]\nmm_per_px = 0.04\n[start]", "[camera] origin_px is missing"),
    ],
)
def test_a_refusal_names_file_key_value_and_rule(toml, line, by, sentence):
    assert line in toml
    problems = refused(toml.replace(line, by))
    assert all(problem.startswith("experiment.toml: ") for problem in problems)
    assert any(sentence in problem for problem in problems)


def test_every_problem_is_listed_at_once(toml):
    text = toml.replace("thickness_mm = 40.0", "thickness_mm = -1.0").replace("[loading]", "[loading]\nspeed = 3\n")
    problems = refused(text.replace("f_max_n = 71.0", "f_max_n = 0.0") + "\n[extra]\n")
    keys = ["thickness_mm = -1.0 must", "speed is not", "f_max_n = 0.0 must", "extra is not"]
    assert sorted(k for k in keys for p in problems if k in p) == sorted(keys)
    assert len(problems) == len(keys)


def test_a_slip_in_one_section_leaves_the_others_readable(toml):
    sections, problems = parse_experiment(tomllib.loads(toml.replace("thickness_mm", "thick_mm")))
    assert problems
    assert "specimen" not in sections
    assert sections["start"].f_max_n == 71.0
    assert sections["observation"].cmod_count == 10


def test_the_model_cannot_be_changed(tmp_path, toml):
    experiment = read(tmp_path, toml)
    with pytest.raises(ValueError, match="frozen"):
        experiment.material.poissons_ratio = 0.1


def test_a_missing_or_broken_file_is_named(tmp_path, toml):
    with pytest.raises(MissingFileError, match=r"experiment\.toml is missing"):
        read_experiment(tmp_path / "experiment.toml")
    with pytest.raises(InputError, match=r"experiment\.toml is not valid TOML.*line 1"):
        read(tmp_path, "format = \n")
    (tmp_path / "experiment.toml").write_bytes(b"\xff\xfe" + toml.encode("utf-16-le"))
    with pytest.raises(InputError, match="is not UTF-8 text"):
        read_experiment(tmp_path / "experiment.toml")
    with pytest.raises(BundleError, match="specimen is missing"):
        read(tmp_path, "format = 1\nname = 'x'\n")


def test_a_byte_order_mark_and_crlf_are_accepted(tmp_path, toml):
    (tmp_path / "experiment.toml").write_bytes(b"\xef\xbb\xbf" + toml.replace("\n", "\r\n").encode())
    assert read_experiment(tmp_path / "experiment.toml").name == "beam-1"
