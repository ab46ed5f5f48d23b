"""The command `creep`: from a laboratory's file to constants, files and figures."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import run

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.prony import PronySeries
from pipeline.materials.shift_laws import Wlf
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord, read_creep
from pipeline.store.layouts import CREEP
from pipeline.store.new import Contents, first_experiment, write_bundle
from pipeline.store.results import read_arrays
from pipeline.study.assembly import build_model
from pipeline.study.creep_analysis import analyse_creep

READINGS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000.0])  # s, AASHTO T 322
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)
LEVELS = np.array([-24.0, -12, 0])
LAW = Wlf(15.0, 120.0, 261.15)
CHAIN = KelvinChain(5e-11, 1e-14, np.geomspace(0.1, 3, 8) * 1e-10, np.geomspace(0.03, 3e4, 8))


def one_temperature(folder: Path, noise: float = 0.0) -> Path:
    """A clean file of the mastic at -12 °C."""
    scatter = np.exp(noise * np.random.default_rng(4).normal(size=READINGS.size))
    rows = zip(READINGS, MASTIC.creep_compliance(READINGS) * 1e9 * scatter, strict=True)
    text = "time_s,compliance_1_per_gpa,temperature_c\n" + "".join(f"{t:g},{d:.9g},-12\n" for t, d in rows)
    (folder / "mastic.csv").write_text(text)
    return folder / "mastic.csv"


def three_temperatures(folder: Path, noise: float = 0.005) -> Path:
    """A spreadsheet's export with one column a temperature."""
    random = np.random.default_rng(2)
    lines = ["Time (s);" + ";".join(f"D at {t:g} °C (1/GPa)" for t in LEVELS)]
    for time in READINGS:
        at = CHAIN.creep_compliance(time / 10 ** LAW.log_shift(LEVELS + 273.15)) * 1e9
        cells = at * np.exp(noise * random.normal(size=at.size))
        lines.append(f"{time:g};" + ";".join(f"{d:.5g}".replace(".", ",") for d in cells))
    (folder / "isotherms.csv").write_text("\n".join(lines) + "\n")
    return folder / "isotherms.csv"


def test_one_temperature_gives_the_constants_back(tmp_path):
    out = tmp_path / "out"
    ended = run("creep", one_temperature(tmp_path), "-o", out)
    assert (ended.exit_code, ended.stderr) == (0, "creep compliance\n")
    assert ended.stdout.endswith(f"result: {out}\n")
    result = json.loads((out / "result.json").read_text())
    assert result["command"] == "creep"
    assert result["temperature_c"] == -12
    burgers = result["burgers"]
    # nine digits are written; τ₂ is known to a hundred times that
    assert [burgers[k] for k in ("d1_per_gpa", "d2_per_gpa", "eta1_gpa_s", "tau2_s")] == pytest.approx(
        [0.1, 0.07, 3000, 80], rel=1e-6
    )
    exact = MASTIC.relaxation()
    arms = result["relaxation"]
    assert [arm["modulus_gpa"] * 1e9 for arm in arms] == pytest.approx(exact.modulus, rel=1e-6)  # as above
    assert [arm["time_s"] for arm in arms] == pytest.approx(exact.time, rel=1e-6)  # as above
    assert result["rms_log_error"] < 1e-8  # nine digits
    assert result["master_curve"] is None
    for name in ("report.html", "creep_compliance.png", "relaxation_modulus.png", "results.h5"):
        assert (out / name).stat().st_size > 1000


def test_intervals_stand_beside_the_constants(tmp_path):
    run("creep", one_temperature(tmp_path, noise=0.02), "-o", tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    for key, value in result["burgers"].items():
        low, high = result["interval_95"][key]
        assert low < value < high


def test_several_temperatures_become_a_master_curve(tmp_path):
    out = tmp_path / "out"
    ended = run("creep", three_temperatures(tmp_path), "-o", out, "--temperature-c", -12)
    assert ended.exit_code == 0, ended.stderr
    result = json.loads((out / "result.json").read_text())
    shifts = {row["temperature_c"]: row["log10_shift"] for row in result["master_curve"]["shifts"]}
    for level in LEVELS:
        assert shifts[level] == pytest.approx(float(LAW.log_shift(level + 273.15)), abs=0.03)  # 0.5 % noise
    assert result["shift_laws"]["wlf"]["rms_log10"] < 1e-6  # two constants through two shifts
    assert result["shift_laws"]["arrhenius"]["activation_energy_kj_per_mol"] > 100
    assert result["prony"]["rms_log_error"] < 0.01  # 0.5 % noise
    values = read_arrays(out, CREEP)
    inside = (values["fit/time_s"] > 0.1) & (values["fit/time_s"] < 1e4)
    truth = CHAIN.creep_compliance(values["fit/time_s"])
    difference = np.log(values["prony/compliance_per_pa"] / truth)[inside]
    assert np.abs(difference).max() < 0.03  # noise, and shifts of 0.01 decades
    assert (out / "master_curve.png").exists()
    assert (out / "shift_factors.png").exists()


def test_a_temperature_between_lies_between():
    time, level = np.tile(READINGS, 3), np.repeat(LEVELS, READINGS.size)
    compliance = CHAIN.creep_compliance(time / 10 ** LAW.log_shift(level + 273.15))
    record = CreepRecord(time, compliance, level)
    found = analyse_creep(record, -18.0)
    wanted = CHAIN.creep_compliance(READINGS / 10 ** float(LAW.log_shift(np.array(255.15))))
    # WLF through three exact shifts, a series with two terms a decade
    assert found.chain.creep_compliance(READINGS) == pytest.approx(wanted, rel=0.03)


def test_creep_csv_of_the_results_is_that_of_a_bundle(tmp_path):
    run("creep", three_temperatures(tmp_path), "-o", tmp_path / "out")
    record = read_creep(tmp_path / "out" / "creep.csv")
    assert np.unique(record.temperature_c).tolist() == LEVELS.tolist()
    assert record.time.size == 30


def test_park_1999_through_the_whole_command(tmp_path, shared_data):
    # the interconverted compliance of a published set, written as a laboratory would, comes back as its modulus
    from pipeline.materials.interconversion import compliance_of

    time, modulus = np.loadtxt(shared_data / "asphalt_viscomodule" / "Park1999.csv", delimiter=",").T
    park = PronySeries(2.24e3, modulus * 1e3, time)  # kPa; E(0) = 2.2 GPa
    at = np.geomspace(0.1, 1e4, 60)
    rows = zip(at, compliance_of(park).creep_compliance(at) * 1e6, strict=True)
    (tmp_path / "park.csv").write_text("t (s)\tD (1/MPa)\n" + "".join(f"{t:.9g}\t{d:.9g}\n" for t, d in rows))
    ended = run("creep", tmp_path / "park.csv", "-o", tmp_path / "out")
    assert ended.exit_code == 0, ended.stderr
    values = read_arrays(tmp_path / "out", CREEP)
    inside = (values["fit/time_s"] > 1) & (values["fit/time_s"] < 1e3)
    truth = park.relaxation_modulus(values["fit/time_s"])
    difference = np.abs(np.log(values["prony/modulus_pa"] / truth))[inside]
    assert difference.max() < 0.025  # two terms a decade; measured: 1.6 %
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["warnings"]  # five decades are too many for one retardation time
    assert "narrow the window" in result["warnings"][-1]


def test_the_example_is_what_its_script_writes_and_is_understood(tmp_path, monkeypatch):
    root = Path(__file__).resolve().parents[2]
    shipped = root / "pipeline" / "examples" / "creep" / "isotherms.csv"
    monkeypatch.setattr("sys.argv", ["make_creep_example.py", str(tmp_path / "isotherms.csv")])
    made = runpy.run_path(str(root / "scripts" / "make_creep_example.py"), run_name="__main__")
    assert (tmp_path / "isotherms.csv").read_bytes() == shipped.read_bytes()
    run("creep", shipped, "-o", tmp_path / "out", "--temperature-c", -12, "--times", "1,200")
    laws = json.loads((tmp_path / "out" / "result.json").read_text())["shift_laws"]["wlf"]
    for key, truth in (("c1", made["LAW"].c1), ("c2_k", made["LAW"].c2)):
        low, high = laws["interval_95"][key]
        assert low < truth < high


def test_the_window_chooses_what_burgers_is_fitted_to(tmp_path):
    file = three_temperatures(tmp_path)
    wide, narrow = tmp_path / "wide", tmp_path / "narrow"
    run("creep", file, "-o", wide)
    run("creep", file, "-o", narrow, "--times", "1,100")
    errors = [json.loads((o / "result.json").read_text())["rms_log_error"] for o in (wide, narrow)]
    assert errors[1] < 0.6 * errors[0]


BAD = {
    "no unit": ("time_s,compliance\n1,1\n2,2\n3,3\n", "states no unit of compliance"),
    "too few": ("time_s,d_1_per_gpa\n1,1\n2,2\n30,3\n", "3 readings of creep compliance: a Burgers fit needs"),
    "a modulus": (
        "time_s,d_1_per_gpa\n" + "".join(f"{t:g},{1 / t:g}\n" for t in READINGS),
        "does not grow",
    ),
    "negative": ("time_s,d_1_per_gpa\n1,-1\n2,2\n30,3\n", "row 2: compliance = -1 1/GPa must be positive"),
    "empty": ("", "no table of numbers"),
}


@pytest.mark.parametrize(("text", "sentence"), BAD.values(), ids=BAD)
def test_bad_files_get_one_message(tmp_path, text, sentence):
    (tmp_path / "bad.csv").write_text(text)
    ended = run("creep", tmp_path / "bad.csv", "-o", tmp_path / "out")
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert ended.stderr.count("cohesive-bpm: ") == 1
    assert sentence in ended.stderr
    assert "fault of the program" not in ended.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--temperature-c", -20), "-20 °C lies outside the record, only -12 °C"),
        (("--times", "1,5"), "3 readings of creep compliance: a Burgers fit needs at least 6"),
    ],
)
def test_questions_beyond_the_record_are_refused(tmp_path, options, sentence):
    ended = run("creep", one_temperature(tmp_path), "-o", tmp_path / "out", *options)
    assert ended.exit_code == 1
    assert sentence in ended.stderr


@pytest.mark.parametrize("options", [("--times", "5,1"), ("--times", "5"), ("--temperature-c", "warm")])
def test_wrong_usage_is_exit_2(tmp_path, options):
    assert run("creep", one_temperature(tmp_path), "-o", tmp_path / "out", *options).exit_code == 2


def test_a_temperature_that_no_record_names_is_refused():
    record = CreepRecord(READINGS, MASTIC.creep_compliance(READINGS))
    with pytest.raises(InputError, match="names no temperature"):
        analyse_creep(record, -12.0)


def test_results_of_another_command_are_not_written_over(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "result.json").write_text('{"command": "identify"}')
    ended = run("creep", one_temperature(tmp_path), "-o", out)
    assert ended.exit_code == 1
    assert "holds results of the command identify" in ended.stderr
    (out / "result.json").unlink()
    (out / "experiment.toml").write_text("")
    assert "is a bundle" in run("creep", one_temperature(tmp_path), "-o", out).stderr


def test_every_key_of_the_result_is_explained(tmp_path):
    run("creep", three_temperatures(tmp_path), "-o", tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    named = set(re.findall(r"`(\w+)`", (Path(__file__).resolve().parents[2] / "docs" / "bundle.md").read_text("utf-8")))
    assert keys(result) <= named


def keys(value: object) -> set[str]:
    """Every key in a result, however deep."""
    if isinstance(value, dict):
        return set(value) | set[str]().union(*(keys(item) for item in value.values()))
    return set[str]().union(*(keys(item) for item in value)) if isinstance(value, list) else set()


def creeping_bundle(folder: Path, creep: str, temperature: str = "-12.0") -> Path:
    """A bundle that states no modulus of the mastic, but how it creeps."""
    write_bundle(folder, first_experiment("seb", folder.name), Contents())
    text = (folder / "experiment.toml").read_text()
    text = re.sub(r"^mastic_modulus_gpa.*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"^#? ?temperature_c.*$", f"temperature_c = {temperature}", text, flags=re.MULTILINE)
    text = re.sub(r"^particle_radius_mm.*$", "particle_radius_mm = 2.0", text, flags=re.MULTILINE)
    (folder / "experiment.toml").write_text(text)
    (folder / "creep.csv").write_text(creep)
    return folder


def test_a_bundle_without_modulus_takes_that_of_its_creep_record(tmp_path):
    record = one_temperature(tmp_path).read_text()
    model = build_model(read_bundle(creeping_bundle(tmp_path / "b", record)))
    assert model.mixture.mastic_modulus == pytest.approx(1 / MASTIC.d1, rel=1e-6)  # nine digits are written
    assert "modulus of the mastic 10 GPa, 1/D₁ of creep.csv" in model.remarks


def test_a_record_that_misses_the_temperature_of_the_test_is_refused(tmp_path):
    record = one_temperature(tmp_path).read_text()
    bundle = read_bundle(creeping_bundle(tmp_path / "b", record, temperature="-20.0"))
    with pytest.raises(InputError, match=r"creep\.csv: -20 °C lies outside the record, only -12 °C"):
        build_model(bundle)
