"""Bundles that we make are bundles that we read."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError, StoreError
from pipeline.core.units import MM
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord
from pipeline.store.experiment import read_experiment
from pipeline.store.images import read_grey, read_labels
from pipeline.store.new import Contents, first_experiment, new_bundle, write_bundle
from pipeline.store.records import read_record


@pytest.mark.parametrize("geometry", ["seb", "dct"])
def test_a_new_bundle_passes_its_own_check(tmp_path, geometry):
    told = new_bundle(tmp_path / "my test", geometry)
    bundle = read_bundle(tmp_path / "my test", thorough=True)
    assert told == ()
    assert bundle.name == "my-test"
    assert bundle.specimen.geometry == geometry
    assert [p.name for p in (tmp_path / "my test").iterdir()] == ["experiment.toml"]


def test_the_first_settings_are_the_papers():
    beam, disk = first_experiment("seb", "a"), first_experiment("dct", "b")
    assert (beam.loading.cmod_rate_mm_per_min, disk.loading.cmod_rate_mm_per_min) == (0.5, 1.0)
    assert beam.start.f_max_n == 71.0
    assert disk.start.f_max_n == 71.0 * 50 / 40  # f_max/(2 r t) of the beam
    with pytest.raises(InputError, match="geometry 'ct' is not known: choose seb or dct"):
        first_experiment("ct", "c")


def test_a_folder_with_anything_in_it_is_refused_and_left(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="is not empty"):
        new_bundle(tmp_path, "seb")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="file cannot be written"):
        new_bundle(tmp_path / "file", "seb")


def test_a_machines_record_becomes_a_clean_curve(tmp_path, curve):
    rows = zip(curve.time + 12, curve.cmod * 1e6 + 40, curve.load / 1e3, strict=True)
    text = "Zeit [s];COD [µm];Kraft [kN]\r\n" + "\r\n".join(
        f"{t:.6f};{c:.6f};{p:.6f}".replace(".", ",") for t, c, p in rows
    )
    (tmp_path / "machine.txt").write_bytes(text.encode("latin-1"))
    told = new_bundle(tmp_path / "beam", "seb", read_record(tmp_path / "machine.txt"))
    assert not any("To look at" in sentence for sentence in told)
    bundle = read_bundle(tmp_path / "beam")
    at = np.array([0.05, 0.1, 0.3]) * MM
    assert np.allclose(
        bundle.curve.load_at(at), curve.load_at(at), rtol=0.02
    )  # the rise is not straight: foot 0.2 µm off
    assert bundle.loading.cmod_rate == pytest.approx(0.5 * MM / 60, rel=0.01)  # the record's own rate, toe cut


def test_a_record_that_does_not_suit_the_first_sizes_is_pointed_out(tmp_path, curve):
    text = "time_s,cmod_mm,load_n\n" + "\n".join(
        f"{t:.6g},{c:.6g},{p:.6g}" for t, c, p in zip(curve.time, curve.cmod / MM, curve.load / 1e3, strict=True)
    )
    (tmp_path / "kn.csv").write_text(text)
    told = new_bundle(tmp_path / "beam", "seb", read_record(tmp_path / "kn.csv"))
    assert any("To look at" in sentence and "is this kN?" in sentence for sentence in told)


def test_an_envelope_brings_its_scatter(tmp_path, shared_data):
    record = read_record(shared_data / "concrete_cmod_pypd" / "half_notched_beam.csv", cmod_rate=0.05 * MM / 60)
    new_bundle(tmp_path / "beam", "seb", record, cmod_rate=0.05 * MM / 60)
    bundle = read_bundle(tmp_path / "beam")
    assert bundle.noise.load_std == pytest.approx(record.load_std, rel=1e-3)  # four digits are written
    assert np.all(bundle.curve.load_std == bundle.noise.load_std)
    assert bundle.loading.cmod_rate_mm_per_min == 0.05
    assert np.allclose(bundle.curve.load, record.curve.load, rtol=1e-11)  # twelve digits are written


def test_everything_that_is_written_reads_back(tmp_path, curve, field):
    labels = np.ones((120, 274), np.uint8)
    labels[40:60, 80:120] = 2
    experiment = first_experiment("seb", "virtual")
    placed = {"mm_per_px": 0.5, "origin_px": (137.0, 120.0)}
    specimen = experiment.specimen.model_copy(update={"image": type(experiment).model_fields and _frame(placed)})
    experiment = experiment.model_copy(update={"specimen": specimen})
    creep = CreepRecord(np.array([1.0, 10.0]), np.array([1e-10, 2e-10]))
    write_bundle(tmp_path / "out", experiment, Contents(curve=curve, fields=field, labels=labels, creep=creep))
    bundle = read_bundle(tmp_path / "out", thorough=True)
    assert bundle.experiment == experiment
    assert read_experiment(tmp_path / "out" / "experiment.toml") == experiment
    assert np.allclose(bundle.curve.load, curve.load, rtol=1e-11, atol=0)  # twelve digits are written
    assert np.allclose(bundle.fields.displacement, field.displacement, rtol=1e-15, atol=0)  # m → mm → m
    assert np.array_equal(read_labels(bundle.labels), labels)
    assert np.allclose(bundle.creep.compliance, creep.compliance, rtol=1e-11)  # twelve digits are written


def _frame(values):
    from pipeline.store.sections import PixelFrame

    return PixelFrame(**values)


def test_speckle_images_are_written_one_after_the_other(tmp_path):
    images = np.random.default_rng(0).integers(0, 255, (3, 120, 274), dtype=np.uint8)
    experiment = first_experiment("seb", "virtual").model_copy(
        update={"camera": _frame({"mm_per_px": 0.5, "origin_px": (137.0, 120.0)})}
    )
    time = np.array([0.0, 0.2, 0.4])
    write_bundle(tmp_path / "out", experiment, Contents(images=iter(images), frame_time=time))
    bundle = read_bundle(tmp_path / "out", thorough=True)
    assert bundle.frame_time.tolist() == time.tolist()
    assert all(np.array_equal(read_grey(p), image) for p, image in zip(bundle.images, images, strict=True))


def test_writing_again_gives_the_same_bytes(tmp_path, curve, field):
    contents = Contents(curve=curve, fields=field)
    for name in ("a", "b"):
        write_bundle(tmp_path / name, first_experiment("seb", "x"), contents)
    write_bundle(tmp_path / "b", first_experiment("seb", "x"), contents)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_two_sources_of_the_same_thing_are_not_written(tmp_path, field):
    experiment = first_experiment("seb", "x")
    both = Contents(fields=field, images=[np.zeros((4, 4), np.uint8)], frame_time=np.zeros(1))
    with pytest.raises(InputError, match="cannot hold this together with a second source"):
        write_bundle(tmp_path / "out", experiment, both)
    (tmp_path / "out" / "images").mkdir(parents=True)
    with pytest.raises(InputError, match="cannot hold this together with images"):
        write_bundle(tmp_path / "out", experiment, Contents(fields=field))
    shutil.rmtree(tmp_path / "out")
    write_bundle(tmp_path / "out", experiment, replace(both, images=(), frame_time=None))
