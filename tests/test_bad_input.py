"""Bad input from the command line: one clear message, the right exit code, and nothing lost."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from helpers.bundles import edit, make_bundle
from helpers.commands import start
from typer.testing import CliRunner, Result

from pipeline.cli import app

FAULT = "fault of the program"
PARAMETERS = ("--f-max", "355", "--delta-max", "1.14e-4")
DAMAGE = Callable[[Path], object]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle in which nothing is wrong, and which is only copied."""
    return make_bundle(tmp_path_factory.mktemp("bundles") / "coarse")


@pytest.fixture(scope="module")
def simulated(sound: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of one simulation of the sound bundle, and a deck."""
    out = tmp_path_factory.mktemp("results") / "out"
    for line in (("model", sound, "-o", out), ("simulate", sound, "-o", out, *PARAMETERS)):
        done = run(*line)
        assert done.exit_code == 0, done.stderr
    return out


@pytest.fixture
def bundle(sound: Path, tmp_path: Path) -> Path:
    """A copy of the sound bundle to be spoilt."""
    return Path(shutil.copytree(sound, tmp_path / "bundle"))


def run(*line: object) -> Result:
    """The command in this process."""
    return CliRunner().invoke(app, [str(word) for word in line], env={"COLUMNS": "200"})


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_one_message(told: str, *expected: str) -> None:
    """One message ends what was told, in words of ours."""
    assert told.count("cohesive-bpm: ") == 1
    message = told[told.index("cohesive-bpm: ") :]
    for text in expected:
        assert text in message
    assert FAULT not in told
    assert "Traceback" not in told
    assert "Warning" not in told


def assert_refused(folder: Path, line: tuple[object, ...], *expected: str) -> None:
    """The command ends with one message and exit code 1; every file below `folder` is as before."""
    before = contents(folder)
    ended = run(*line)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(ended.stderr, *expected)
    assert before.items() <= contents(folder).items()
    assert not list(folder.rglob("*.part"))


def lines(command: str, bundle: Path) -> tuple[object, ...]:
    """A command on a bundle, with results beside it."""
    more = {"check": (), "model": (), "simulate": PARAMETERS, "identify": ("--grid", "0.9,1,1.1")}[command]
    place = () if command == "check" else ("-o", bundle.parent / "out")
    return (command, bundle, *place, *more)


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


def cut_off(name: str, size: int) -> DAMAGE:
    return lambda bundle: os.truncate(bundle / name, size)


def filled(name: str, content: bytes) -> DAMAGE:
    return lambda bundle: (bundle / name).write_bytes(content)


def folder_instead(name: str) -> DAMAGE:
    def damage(bundle: Path) -> None:
        (bundle / name).unlink(missing_ok=True)
        (bundle / name).mkdir()

    return damage


def photograph(image: np.ndarray, name: str = "specimen.png") -> DAMAGE:
    def damage(bundle: Path) -> None:
        (bundle / "labels.png").unlink()
        cv2.imwrite(str(bundle / name), image)

    return damage


def labels(value: int) -> DAMAGE:
    return lambda bundle: cv2.imwrite(str(bundle / "labels.png"), np.full((121, 275), value, np.uint8))


def rows(change: Callable[[list[str]], list[str]]) -> DAMAGE:
    def damage(bundle: Path) -> None:
        path = bundle / "load_cmod.csv"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    return damage


def row_8(cmod: str | None = None, load: str | None = None) -> DAMAGE:
    """Write something else into one row of the record."""

    def change(table: list[str]) -> list[str]:
        cells = table[7].split(",")
        return [*table[:7], f"{cells[0]},{cmod if cmod is not None else cells[1]},{load or cells[2]}", *table[8:]]

    return rows(change)


def up_to_the_peak(table: list[str]) -> list[str]:
    loads = [float(row.split(",")[2]) for row in table[1:]]
    return table[: 2 + loads.index(max(loads))]


def field(name: str, change: Callable[[np.ndarray], np.ndarray]) -> DAMAGE:
    """Replace a dataset of fields.h5."""

    def damage(bundle: Path) -> None:
        with h5py.File(bundle / "fields.h5", "r+") as file:
            values, attributes = file[name][()], dict(file[name].attrs)
            del file[name]
            file[name] = change(values)
            file[name].attrs.update(attributes)

    return damage


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


@pytest.mark.parametrize("command", ["model", "simulate", "identify"])
@pytest.mark.parametrize("place", ["out", "out/below", "/dev/null", "/proc/out"])
def test_where_no_folder_can_be_is_refused(bundle, command, place):
    (bundle.parent / "out").write_text("precious")
    told = f"{bundle.parent / place} cannot be written: "
    assert_refused(bundle.parent, (*lines(command, bundle), "-o", bundle.parent / place), told, "choose another output")


@pytest.mark.parametrize("command", ["model", "simulate", "identify"])
@pytest.mark.parametrize("place", ["bundle", "bundle/images", "bundle/images/out"])
def test_results_are_kept_out_of_the_bundle_itself(bundle, command, place):
    assert_refused(bundle.parent, (*lines(command, bundle), "-o", bundle.parent / place), "choose another -o")
    assert run("check", bundle).exit_code == 0


def test_a_virtual_test_is_not_made_over_a_measured_one(bundle):
    told = "holds a bundle that is no virtual test (no truth.json)"
    assert_refused(bundle.parent, ("virtual-test", bundle, "--radius-mm", "2"), told)
    assert_refused(bundle.parent, ("new", bundle, "--geometry", "seb"), "is not empty")


def test_a_virtual_test_that_was_stopped_is_made_again_in_its_place(tmp_path):
    out = tmp_path / "virtual"
    line = ("virtual-test", out, "--radius-mm", "2")
    assert_refused(tmp_path, (*line, "--delta-max", "1e-8"), "must be larger than delta_peak")
    assert_refused(tmp_path, (*line, "--specimen", tmp_path / "no.png", "--mm-per-px", "1"), "no.png: does not exist")
    made = run(*line)
    assert made.exit_code == 0, made.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "experiment.toml",
        "fields.h5",
        "labels.png",
        "load_cmod.csv",
        "truth.json",
    ]
    assert run("check", out).exit_code == 0


def test_two_bundles_do_not_share_their_results(bundle, simulated, tmp_path):
    out = shutil.copytree(simulated, tmp_path / "out")
    edit(bundle, name='"another"')
    for command in ("model", "simulate", "identify"):
        assert_refused(tmp_path, lines(command, bundle), f"{out} holds the results of bundle 'coarse'")


def test_a_folder_where_simulations_cannot_be_kept_is_told_before_the_first(bundle, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "simulations").write_text("precious")
    for command in ("simulate", "identify"):
        assert_refused(tmp_path, lines(command, bundle), "a file stands where a folder is needed")


@contextlib.contextmanager
def files_limited_to(size: int) -> Iterator[None]:
    """No file of this process or those it starts may grow beyond a size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(
    ("command", "size", "file"),
    [("simulate", 40_000, "results.h5"), ("simulate", 200_000, "report.html"), ("model", 20_000, "lammps")],
)
def test_a_file_that_may_not_grow_leaves_what_was_there(simulated, sound, tmp_path, command, size, file):
    """The limit stands for a full disk: a write fails in the middle. The simulation itself is kept already."""
    out = Path(shutil.copytree(simulated, tmp_path / "out"))
    before = contents(out)
    with files_limited_to(size):
        ended = run(*lines(command, sound), "-o", out)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(
        ended.stderr, f"{out / file} cannot be written: the file would be larger than this system allows"
    )
    after = contents(out)
    assert before.keys() == after.keys()
    changed = {path.name for path in before if before[path] != after[path]}
    assert changed <= ({"result.json"} if file == "report.html" else set())  # its numbers are new, and whole
    json.loads((out / "result.json").read_text("utf-8"))


def test_a_scratch_folder_that_is_full_is_named(sound, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    with files_limited_to(10_000):
        ended = run(*lines("simulate", sound), "-o", tmp_path / "out")
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(ended.stderr, f"{scratch}: File too large", "let TMPDIR name another folder")
    assert list(scratch.iterdir()) == []


def without_rights(*line: object) -> subprocess.CompletedProcess[str]:
    """The command as somebody whom permissions bind, which root is not."""
    prefix: list[str] = []
    if os.geteuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("permissions do not bind root, and setpriv is not here to make them")
        prefix = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]
    command = [*prefix, sys.executable, "-m", "pipeline", *map(str, line)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


def test_missing_permissions_are_told(bundle, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(0o555)
    ended = without_rights("model", bundle, "-o", closed / "out")
    assert ended.returncode == 1
    assert_one_message(ended.stderr, f"{closed / 'out'} cannot be written: permission is denied")
    for name in ("load_cmod.csv", "fields.h5", "labels.png"):
        (bundle / name).chmod(0)
    ended = without_rights("check", bundle)
    assert ended.returncode == 1
    told = ("load_cmod.csv: cannot be read", "fields.h5: there is no permission", "labels.png: cannot be read")
    assert_one_message(ended.stderr, *told)


def test_a_reader_who_leaves_is_no_error_worth_words(sound):
    process = start("check", sound, scratch=sound.parent / "scratch")
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=60) in (1, -signal.SIGPIPE)
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()
