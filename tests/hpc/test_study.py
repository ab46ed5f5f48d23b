"""Export, run without Python, collect: the same fit as here, whatever is killed; what is damaged is named."""

from __future__ import annotations

import errno
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hpc.studies import bare_path, kill_after, load_bundle, run_point, start_point, use_the_wheel
from pipeline.cli import app
from pipeline.core.errors import BundleError, InputError, StoreError
from pipeline.hpc.manifest import FILE
from pipeline.lmp.output import read_curve
from pipeline.lmp.ranks import environment
from pipeline.study.collect import collect
from pipeline.study.export import export
from pipeline.study.identify import identify

GRID = (0.9, 1.0, 1.1)
SAME = 1e-8  # asked for; the same bits where both styles were compiled with the flags of CMakeLists.txt


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return load_bundle(tmp_path_factory.mktemp("test") / "bundle", "a-name-of-its-own")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return bare_path(tmp_path_factory.mktemp("path") / "bin")


@pytest.fixture(scope="module")
def exported(bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of nine points that nobody has run."""
    out = tmp_path_factory.mktemp("exported") / "study"
    export(bundle, out, grid=GRID, restart_steps=1000)
    use_the_wheel(out)
    return out


@pytest.fixture(scope="module")
def done(exported: Path, path: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same study, run; the last point in pieces."""
    out = tmp_path_factory.mktemp("done") / "study"
    shutil.copytree(exported, out)
    for number in range(8):
        code, told = run_point(out, number, path)
        assert code == 0, told
    pieces = 0
    while kill_after(start_point(out, 8, path), 0.15 + 0.05 * pieces):
        pieces += 1
    code, told = run_point(out, 8, path)
    assert (code, told) == (0, "point 0008 is done\n")
    return out


@pytest.fixture
def study(done: Path, tmp_path: Path) -> Path:
    """A copy of the run study, to be damaged."""
    shutil.copytree(done, tmp_path / "study")
    return tmp_path / "study"


def test_collect_gives_what_identify_gives(study: Path, bundle: Path, tmp_path: Path) -> None:
    identify(bundle, tmp_path / "here", grid=GRID, workers=2)
    shutil.rmtree(bundle.parent / "gone", ignore_errors=True)
    collect(study)
    here, there = (json.loads((folder / "result.json").read_text()) for folder in (tmp_path / "here", study))
    for name in ("f_max_n", "delta_max_m", "objective_min", "peak_load_n"):
        assert there[name] == pytest.approx(here[name], rel=SAME)
    assert there["simulations"] == here["simulations"]
    assert "9 points were run elsewhere by LAMMPS 22 Jul 2025" in there["remarks"][-1]


def test_a_point_killed_and_continued_is_that_of_an_uninterrupted_run(
    exported: Path, path: str, tmp_path: Path
) -> None:
    curves = []
    for name in ("whole", "pieces"):
        out = tmp_path / name
        shutil.copytree(exported, out)
        killed = 0
        while name == "pieces" and killed < 12 and kill_after(start_point(out, 0, path), 0.12 + 0.03 * killed):
            killed += 1
        code, told = run_point(out, 0, path)
        assert code == 0, told
        curves.append(read_curve(out / "points/0000/curve.txt"))
    for column, other in zip(curves[0].values(), curves[1].values(), strict=True):
        assert (column == other).all(), "the same bits, no row lost, none twice"
    assert not list((out / "points/0000").glob("restart.*")), "what is done keeps no restart files"


def test_what_is_missing_is_named_and_the_rest_is_kept(study: Path, path: str) -> None:
    shutil.rmtree(study / "points/0001")
    (study / "points/0004/results.sha256").unlink()
    for name in ("results.sha256", "curve.txt", "frames.dump", "bonds.dump"):
        (study / "points/0005" / name).unlink()
    with pytest.raises(StoreError) as caught:
        collect(study)
    assert str(caught.value).splitlines() == [
        "6 of 9 points are whole and kept; the fit needs them all",
        "points/0001 is missing: its folder is not there; copy it back",
        "points/0004 is not finished: it was stopped, or is under way; unless it is, run point 4 again",
        "points/0005 is missing: it was never run; run point 5 again",
    ]
    assert len(list((study / "simulations").glob("*.h5"))) == 6
    assert run_point(study, 4, path)[0] == 0


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("frames.dump", "frames.dump has another checksum"),
        ("curve.txt", "curve.txt has another checksum"),
        ("bonds.inc", "bonds.inc has another checksum"),
        ("inputs.sha256", "its inputs.sha256 is of another study or was changed"),
    ],
)
def test_a_truncated_file_is_named(study: Path, name: str, told: str) -> None:
    file = study / "points/0002" / name
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    with pytest.raises(StoreError, match=rf"points/0002 is damaged: {told}"):
        collect(study)


def test_damaged_inputs_do_not_run(exported: Path, path: str, tmp_path: Path) -> None:
    out = tmp_path / "study"
    shutil.copytree(exported, out)
    (out / "points/0003/bonds.inc").write_text("bond_coeff 1 1 1 1\n")
    code, told = run_point(out, 3, path)
    assert (code, told) == (
        1,
        "run-point: the inputs of point 0003 are damaged or incomplete: "
        "copy points/0003 again from where it was exported\n",
    )
    assert run_point(out, 9, path) == (1, f"run-point: there is no point 0009 in {out}\n")


def test_two_studies_never_mix(study: Path, bundle: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    export(bundle, other, grid=(0.8, 1.0, 1.2), restart_steps=1000)
    with pytest.raises(InputError, match="holds another study"):
        export(bundle, study, grid=(0.8, 1.0, 1.2), restart_steps=1000)
    for name in ("curve.txt", "frames.dump", "bonds.dump", "results.sha256"):
        shutil.copy(study / "points/0003" / name, other / "points/0003" / name)
    shutil.copytree(study / "points/0004", other / "points/0004", dirs_exist_ok=True)
    with pytest.raises(StoreError) as caught:
        collect(other)
    assert "points/0003 is damaged: its results were made from other inputs" in str(caught.value)
    assert "points/0004 is damaged: its inputs.sha256 is of another study" in str(caught.value)


def test_a_changed_manifest_bundle_or_folder_is_refused(study: Path, bundle: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds other files"):
        export(bundle, bundle.parent)
    text = (study / FILE).read_text()
    (study / FILE).write_text(text.replace('"number": 1', '"number": 2', 1))
    result = CliRunner().invoke(app, ["collect", str(study)])
    assert result.exit_code == 1
    assert "manifest.json was changed after it was written" in result.stderr
    (study / FILE).write_text(text)
    (study / "bundle/load_cmod.csv").write_text("time_s,cmod_mm,load_n\n")
    with pytest.raises(StoreError, match=r"bundle/load_cmod\.csv has another checksum"):
        collect(study)
    result = CliRunner().invoke(app, ["collect", str(tmp_path)])
    assert result.exit_code == 1
    assert "is no exported study" in result.stderr


def test_an_export_again_changes_nothing(exported: Path, bundle: Path) -> None:
    before = {str(file): file.read_bytes() for file in exported.rglob("*") if file.is_file()}
    export(bundle, exported, grid=GRID, restart_steps=1000)
    assert {str(file): file.read_bytes() for file in exported.rglob("*") if file.is_file()} == before


def test_an_export_again_from_its_own_copy_of_the_test_keeps_it(exported: Path, tmp_path: Path) -> None:
    shutil.copytree(exported, tmp_path / "study")
    export(tmp_path / "study/bundle", tmp_path / "study", grid=GRID, restart_steps=1000, walltime_min=7)
    for file in (exported / "bundle").iterdir():
        assert (tmp_path / "study/bundle" / file.name).read_bytes() == file.read_bytes()
    assert "#SBATCH --time=7\n" in (tmp_path / "study/submit.slurm").read_text()


def test_an_export_again_keeps_the_steps_between_restart_files(exported: Path, bundle: Path, tmp_path: Path) -> None:
    shutil.copytree(exported, tmp_path / "study")
    with pytest.raises(InputError, match="every 1000 steps, not every 5000: leave --restart-steps out"):
        export(bundle, tmp_path / "study", grid=GRID, restart_steps=5000)
    export(bundle, tmp_path / "study", grid=GRID)
    assert "every 1000 steps" in (tmp_path / "study/README.md").read_text()


def test_an_export_again_mends_damaged_inputs_and_takes_none_of_another_study(
    study: Path, exported: Path, bundle: Path, tmp_path: Path
) -> None:
    export(bundle, tmp_path / "other", grid=(0.8, 1.0, 1.2), restart_steps=1000)
    (study / "points/0002/bonds.inc").write_text("bond_coeff 1 1 1 1\n")
    shutil.rmtree(study / "points/0003")
    shutil.copytree(tmp_path / "other/points/0003", study / "points/0003")
    export(bundle, study, grid=GRID, restart_steps=1000)
    for point in ("points/0002", "points/0003"):
        for file in (exported / point).iterdir():
            assert (study / point / file.name).read_bytes() == file.read_bytes()
    with pytest.raises(StoreError) as caught:
        collect(study)
    told = str(caught.value).splitlines()
    assert told[0].startswith("8 of 9 points are whole"), "what was run from the same inputs still counts"
    assert told[1:] == ["points/0003 is missing: it was never run; run point 3 again"]


def test_a_launcher_of_the_environment_starts_lammps(exported: Path, path: str, tmp_path: Path) -> None:
    shutil.copytree(exported, tmp_path / "study")
    (tmp_path / "launch").write_text('#!/bin/sh\nshift\nprintf launched >launched\nexec "$@"\n')
    (tmp_path / "launch").chmod(0o755)
    line = [shutil.which("sh") or "sh", str(tmp_path / "study/run-point"), "0"]
    variables = {"PATH": path, "LAUNCHER": f"{tmp_path}/launch -n"}
    subprocess.run(line, env=variables, check=True, capture_output=True, timeout=300)
    assert (tmp_path / "study/points/0000/launched").exists()


def test_a_job_of_several_ranks_is_launched_on_them(bundle: Path, tmp_path: Path) -> None:
    export(bundle, tmp_path / "one", grid=GRID)
    export(bundle, tmp_path / "many", grid=GRID, ranks=64)
    assert "LAUNCHER" not in (tmp_path / "one/submit.slurm").read_text()
    text = (tmp_path / "many/submit.slurm").read_text()
    assert "#SBATCH --ntasks=64\n" in text
    assert "export LAUNCHER=srun\nsh run-point" in text


def test_the_style_is_built_from_a_folder_named_from_where_one_stands(exported: Path, tmp_path: Path) -> None:
    (tmp_path / "lammps/src").mkdir(parents=True)
    (tmp_path / "lammps/src/lammps.h").touch()
    line = [shutil.which("sh") or "sh", str(exported / "style/build"), "--copy", "lammps"]
    subprocess.run(line, cwd=tmp_path, check=True, capture_output=True)
    copied = {file.name for file in (tmp_path / "lammps/src").glob("*.cpp")}
    ours = {file.name for file in (exported / "style").glob("*.cpp") if not file.name.endswith("plugin.cpp")}
    assert copied == ours


def test_a_place_that_cannot_be_written_is_named(bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"file cannot be written: a file stands where a folder is needed"):
        export(bundle, tmp_path / "file", grid=GRID)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr("pipeline.study.export.write_points", full)
        with pytest.raises(StoreError, match=r"study cannot be written: the disk is full"):
            export(bundle, tmp_path / "study", grid=GRID)
    assert "9 points" in export(bundle, tmp_path / "study", grid=GRID), "the same command goes through it again"


def test_another_build_of_the_style_begins_again(exported: Path, path: str, tmp_path: Path) -> None:
    out = tmp_path / "study"
    shutil.copytree(exported, out)
    point = out / "points/0000"
    (point / "restart.1000").write_text("of another build")
    (point / "style.sha256").write_text(f"{'0' * 64}  {out}/style/cohesiveplugin.so\n")
    assert run_point(out, 0, path) == (0, "point 0000 from step 0 on\npoint 0000 is done\n")


EVIL = "a$(touch pwned)`touch pwned`;touch pwned\\n#SBATCH --wrap=x\\nshell touch pwned"


def test_names_of_a_bundle_reach_no_script(exported: Path, bundle: Path, tmp_path: Path) -> None:
    evil = tmp_path / "evil"
    shutil.copytree(bundle, evil)
    text = (evil / "experiment.toml").read_text()
    assert '"a-name-of-its-own"' in text
    (evil / "experiment.toml").write_text(text.replace('"a-name-of-its-own"', f'"{EVIL}"', 1))
    with pytest.raises(BundleError, match=r"name = .* may hold letters, digits, dot, dash and underscore only"):
        export(evil, tmp_path / "study", grid=GRID)
    assert not (tmp_path / "study").exists()
    scripts = [exported / name for name in ("run-point", "environment", "submit.slurm")]
    for file in [*scripts, *(exported / "points").rglob("*.*")]:
        assert b"a-name-of-its-own" not in file.read_bytes(), "nor does a name that is accepted"


@pytest.mark.parametrize("option", ["--partition", "--account"])
@pytest.mark.parametrize("name", ["a b", "x\n#SBATCH --wrap=y", "$(reboot)", "-p", "a;b", ""])
def test_names_of_slurm_are_names(bundle: Path, tmp_path: Path, option: str, name: str) -> None:
    result = CliRunner().invoke(app, ["export", str(bundle), str(tmp_path / "s"), option, name])
    assert result.exit_code == 1
    assert f"slurm_{option[2:]} = {name!r}" in result.stderr
    assert not (tmp_path / "s").exists()


def test_a_stock_study_needs_no_style_of_ours(bundle: Path, path: str, tmp_path: Path) -> None:
    out = tmp_path / "study"
    export(bundle, out, grid=GRID, restart_steps=1000, accuracy=0.05, stock="table")
    assert not (out / "style").exists()
    with (out / "environment").open("a") as file:
        file.write(f"export LD_LIBRARY_PATH='{environment()['LD_LIBRARY_PATH']}'\nunset LAMMPS_PLUGIN_PATH\n")
    kill_after(start_point(out, 4, path), 0.3)
    code, told = run_point(out, 4, path)
    assert code == 0, told
    with pytest.raises(StoreError, match=r"1 of 9 points are whole and kept; the fit needs them all"):
        collect(out)
