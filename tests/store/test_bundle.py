"""Bundles: what is read, and that everything wrong is listed together."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import BundleError, MissingFileError
from pipeline.core.units import MM
from pipeline.store.bundle import read_bundle
from pipeline.store.fields import write_fields
from pipeline.store.images import save_png
from pipeline.store.load_cmod import write_load_cmod

FRAME = "mm_per_px = 0.5\norigin_px = [137.0, 120.0]\n"


def problems(folder, **options) -> list[str]:
    with pytest.raises(BundleError) as error:
        read_bundle(folder, **options)
    return list(error.value.problems)


def edit(folder, old: str, new: str) -> None:
    path = folder / "experiment.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_a_bundle_is_read_into_si(bundle_folder, beam, curve, field):
    bundle = read_bundle(bundle_folder, thorough=True)
    assert bundle.specimen == beam
    assert np.allclose(bundle.curve.cmod, curve.cmod, rtol=1e-11, atol=0)  # twelve digits are written
    assert np.allclose(bundle.fields.displacement, field.displacement, rtol=1e-15, atol=0)  # one product
    assert bundle.fields.abscissa.tolist() == field.abscissa.tolist()
    assert bundle.observation_points.shape == (16, 2)
    assert bundle.stations[0] == pytest.approx(0.05 * MM, rel=0.01)  # the parabola's peak on an asymmetric top
    assert np.allclose(np.diff(bundle.stations), 0.05 * MM, rtol=1e-12)  # equal steps: rounding
    assert bundle.cmod_max == pytest.approx(1.1 * bundle.stations[-1], rel=1e-15)  # last station + 10 %


def test_fields_are_read_when_asked_for_and_only_once(bundle_folder):
    bundle = read_bundle(bundle_folder)
    assert bundle.fields is bundle.fields
    assert "fields" not in vars(read_bundle(bundle_folder))


def test_the_load_gets_the_given_or_the_estimated_scatter(bundle_folder):
    assert np.all(read_bundle(bundle_folder).curve.load_std > 0)
    edit(bundle_folder, "[material]", "[noise]\nload_std_n = 7.5\n[material]")
    assert np.all(read_bundle(bundle_folder).curve.load_std == 7.5)


@pytest.mark.parametrize(("missing", "need"), [("fields.h5", "need_fields"), ("load_cmod.csv", "need_curve")])
def test_fields_or_load_may_be_missing(bundle_folder, missing, need):
    (bundle_folder / missing).unlink()
    bundle = read_bundle(bundle_folder)
    assert (bundle.curve is None) == (missing == "load_cmod.csv")
    assert (bundle.fields is None) == (missing == "fields.h5")
    with pytest.raises(MissingFileError, match=missing):
        getattr(bundle, need)()


def test_the_end_of_the_test_may_be_set(bundle_folder):
    edit(bundle_folder, "[material]", "cmod_max_mm = 0.3\n[material]")
    assert read_bundle(bundle_folder).cmod_max == pytest.approx(0.3 * MM, rel=1e-15)  # rounding of a product


def test_another_radius_rescales_the_start(bundle_folder):
    coarse = read_bundle(bundle_folder).with_radius(6e-4)
    assert coarse.model.radius == pytest.approx(6e-4, rel=1e-15)  # rounding of a product
    assert coarse.start.f_max_n == pytest.approx(142.0, rel=1e-12)  # f_max/(2 r t) kept
    assert coarse.start.delta_max_m == 1.14e-4


def test_what_is_no_bundle_is_refused(tmp_path):
    with pytest.raises(MissingFileError, match="is not a folder"):
        read_bundle(tmp_path / "nowhere")
    assert problems(tmp_path) == [
        f"experiment.toml is missing in {tmp_path}: `cohesive-bpm new DIR` writes one to fill in"
    ]


def test_unknown_files_are_ignored(bundle_folder):
    before = read_bundle(bundle_folder).experiment
    (bundle_folder / "truth.json").write_text("{")
    (bundle_folder / "notes").mkdir()
    assert read_bundle(bundle_folder).experiment == before


def test_all_problems_are_listed_together(bundle_folder, curve):
    """Notch outside, negative thickness, NaN, K^s < 0, damaged fields, two sources: six kinds in one error."""
    edit(bundle_folder, "thickness_mm = 40.0", "thickness_mm = -40.0")
    edit(bundle_folder, "notch_length_mm = 15.0", "notch_length_mm = 65.0")
    edit(bundle_folder, "mastic_modulus_gpa", "poissons_ratio = 0.33\nmastic_modulus_gpa")
    text = (bundle_folder / "load_cmod.csv").read_text().splitlines()
    text[10] = "1,nan,3"
    (bundle_folder / "load_cmod.csv").write_text("\n".join(text))
    content = (bundle_folder / "fields.h5").read_bytes()
    (bundle_folder / "fields.h5").write_bytes(content[: len(content) // 2])
    (bundle_folder / "specimen.png").write_bytes(b"no image")
    save_png(bundle_folder / "labels.png", np.full((10, 10), 9, np.uint8))
    found = problems(bundle_folder)
    wanted = [
        "experiment.toml: [specimen] thickness_mm = -40.0 must be positive",
        "[specimen] notch_length_mm = 65 reaches outside the specimen",
        "[material] poissons_ratio = 0.33 in plane strain gives a negative shear stiffness",
        "load_cmod.csv: row 11: cmod_mm is nan",
        "fields.h5: it is truncated",
        "specimen.png and labels.png: all say what the specimen is made of",
        "labels.png: holds the values 9",
    ]
    assert [any(sentence in problem for problem in found) for sentence in wanted] == [True] * len(wanted)
    assert len(found) == len(wanted)


def test_a_notch_outside_the_specimen_is_named(bundle_folder):
    edit(bundle_folder, "notch_length_mm = 15.0", "notch_length_mm = 60.0")
    assert problems(bundle_folder) == [
        "experiment.toml: [specimen] notch_length_mm = 60 reaches outside the specimen: it must be smaller than "
        "depth_mm = 60"
    ]


@pytest.mark.parametrize(
    ("name", "factor", "sentence"),
    [
        ("cmod", 1e3, "are these micrometres?"),
        ("cmod", 1e-3, "are these metres?"),
        ("load", 1e3, "is this mN?"),
        ("load", 1e-3, "is this kN?"),
        ("time", 1e3, "is time_s in minutes or milliseconds"),
        ("time", 1 / 60, "is time_s in minutes or milliseconds"),
    ],
)
def test_units_wrong_by_1000_are_seen_in_the_record(bundle_folder, curve, name, factor, sentence):
    (bundle_folder / "fields.h5").unlink()
    columns = {k: getattr(curve, k) * (factor if k == name else 1) for k in ("time", "cmod", "load")}
    write_load_cmod(bundle_folder / "load_cmod.csv", LoadCurve(**columns))
    assert any(sentence in problem for problem in problems(bundle_folder))


@pytest.mark.parametrize(
    ("name", "factor", "sentence"),
    [
        ("displacement", 1e3, "are these micrometres? displacement is in mm"),
        ("displacement", 1e-3, "are these metres? displacement is in mm"),
        ("points", 1e3, "most of them off the specimen"),
        ("abscissa", 1e5, "do not overlap those of load_cmod.csv"),
    ],
)
def test_units_wrong_by_1000_are_seen_in_the_fields(bundle_folder, field, name, factor, sentence):
    arrays = vars(field) | {name: getattr(field, name) * factor + (1e5 if name == "abscissa" else 0)}
    write_fields(bundle_folder / "fields.h5", type(field)(**arrays))
    (problem,) = problems(bundle_folder)
    assert problem.startswith("fields.h5: ")
    assert sentence in problem


def test_rigid_motion_of_millimetres_is_no_wrong_unit(bundle_folder, field):
    """DIC of a disk carries millimetres of pin slack: it must not be mistaken for micrometres."""
    turn = 0.005 * np.column_stack([-field.points[:, 1], field.points[:, 0]])
    moved = field.displacement + np.array([2.6, 1.0]) * MM + turn
    write_fields(bundle_folder / "fields.h5", type(field)(**(vars(field) | {"displacement": moved})))
    read = read_bundle(bundle_folder).need_fields()
    np.testing.assert_allclose(read.displacement, moved, rtol=1e-6)  # kept in single precision at worst


def test_labels_need_their_scale_and_an_aggregate_modulus(bundle_folder):
    save_png(bundle_folder / "labels.png", np.ones((120, 274), np.uint8))
    assert "[specimen.image] is missing: labels.png needs mm_per_px" in problems(bundle_folder)[0]
    edit(bundle_folder, "[loading]", f"[specimen.image]\n{FRAME}[loading]")
    bundle = read_bundle(bundle_folder)
    assert bundle.labels.name == "labels.png"
    corner = bundle.image_frame.placement().to_specimen(np.array([[0, 0]]))
    assert np.allclose(corner, [[-0.0685, 0.06]], rtol=0, atol=1e-15)  # top left of the beam: rounding
    edit(bundle_folder, "aggregate_modulus_gpa = 50.0\n", "")
    assert "aggregate_modulus_gpa is missing: labels.png needs it" in problems(bundle_folder)[0]


@pytest.mark.parametrize("wrong", [("mm_per_px = 0.5", "mm_per_px = 0.0005"), ("[137.0, 120.0]", "[137.0, -1200.0]")])
def test_a_photograph_off_the_specimen_is_refused(bundle_folder, wrong):
    save_png(bundle_folder / "specimen.png", np.full((120, 274), 90, np.uint8))
    edit(bundle_folder, "[loading]", f"[specimen.image]\n{FRAME}[loading]".replace(*wrong))
    (problem,) = problems(bundle_folder)
    assert "hardly meets the specimen" in problem
    assert "check mm_per_px" in problem


def test_the_modulus_or_creep_is_needed(bundle_folder):
    edit(bundle_folder, "mastic_modulus_gpa = 10.0\n", "")
    assert problems(bundle_folder) == [
        "experiment.toml: [material] mastic_modulus_gpa is missing: give it, or add creep.csv"
    ]
    (bundle_folder / "creep.csv").write_text("time_s,compliance_1_per_gpa\n1,0.1\n10,0.12\n")
    assert read_bundle(bundle_folder).creep.compliance[1] == pytest.approx(1.2e-10, rel=1e-12)  # rounding


@pytest.mark.parametrize("key", ["shear_strength_ratio", "shear_opening_ratio"])
@pytest.mark.parametrize(("plane", "ratio"), [("strain", 0.25), ("stress", 0.3333)])
def test_a_shear_ratio_is_refused_where_there_is_no_shear_stiffness(bundle_folder, key, plane, ratio):
    edit(bundle_folder, "[start]", f'poissons_ratio = {ratio}\nplane = "{plane}"\n{key} = 0.5\n[start]')
    (problem,) = problems(bundle_folder)
    assert f"{key} = 0.5 cannot be identified" in problem
    edit(bundle_folder, f"poissons_ratio = {ratio}", "poissons_ratio = 0.2")
    assert getattr(read_bundle(bundle_folder).material, key) == 0.5


def test_settings_of_later_versions_are_read(bundle_folder):
    """The study decides what it can do with them."""
    edit(bundle_folder, "[start]", 'softening = "exponential"\nunloading = "elastic"\n[start]')
    material = read_bundle(bundle_folder).material
    assert (material.softening, material.unloading) == ("exponential", "elastic")


@pytest.fixture
def image_bundle(bundle_folder):
    """The bundle with four speckle images instead of fields."""
    (bundle_folder / "fields.h5").unlink()
    (bundle_folder / "images").mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (4, 120, 274), dtype=np.uint8)
    for i, image in enumerate(noise):
        save_png(bundle_folder / "images" / f"{i}.png", image)
    (bundle_folder / "frames.csv").write_text("frame,time_s\n0,0\n1,10\n2,20\n3,30\n")
    edit(bundle_folder, "[material]", f"[camera]\n{FRAME}[material]")
    return bundle_folder


def test_images_with_their_times_are_read(image_bundle):
    bundle = read_bundle(image_bundle, thorough=True)
    assert [path.name for path in bundle.images] == ["0.png", "1.png", "2.png", "3.png"]
    assert bundle.frame_time.tolist() == [0, 10, 20, 30]
    assert bundle.fields is None


def test_images_and_fields_together_are_refused_unless_chosen(image_bundle, field):
    write_fields(image_bundle / "fields.h5", field)
    assert "images/ and fields.h5: both give displacements" in problems(image_bundle)[0]
    chosen = read_bundle(image_bundle, fields=image_bundle / "fields.h5")
    assert chosen.images == ()
    assert chosen.need_fields().points.shape == (16, 2)


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda f: (f / "frames.csv").unlink(), "frames.csv: is missing: images/ needs it"),
        (lambda f: edit(f, f"[camera]\n{FRAME}", ""), "[camera] is missing"),
        (lambda f: [p.unlink() for p in (f / "images").iterdir()], "images/: holds no PNG or TIFF image"),
        (lambda f: (f / "images" / "2.png").write_bytes(b""), "images/2.png: is empty (0 bytes)"),
        (lambda f: (f / "frames.csv").write_text("frame,time_s\n0,900\n1,910\n2,920\n3,930\n"), "do not overlap"),
    ],
)
def test_faulty_image_series_are_named(image_bundle, spoil, sentence):
    spoil(image_bundle)
    assert any(sentence in problem for problem in problems(image_bundle))


def test_a_given_offset_of_the_clock_counts(image_bundle):
    (image_bundle / "frames.csv").write_text("frame,time_s\n0,900\n1,910\n2,920\n3,930\n")
    edit(image_bundle, "[camera]", "[dic]\nsync_offset_s = 900.0\n[camera]")
    assert read_bundle(image_bundle).dic.sync_offset_s == 900.0
