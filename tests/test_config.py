"""Settings of a run: defaults, files, refusals."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from pipeline.config import RunSettings, load_settings, run_settings, settings_table
from pipeline.core.errors import InputError, MissingFileError


def test_defaults_are_those_of_the_command_line():
    settings = RunSettings()
    assert settings.engine == "lammps"
    assert settings.accuracy == 0.01
    assert settings.rigid == "fit"
    assert settings.f_factors == settings.delta_factors == (0.8, 0.9, 1.0, 1.1, 1.2)
    assert settings.recentring_count == 3
    assert settings.recentring_steps == 2
    assert settings.radius is None


def test_units_stand_in_the_key_and_leave_in_si():
    assert run_settings({"radius_mm": 0.6}).radius == pytest.approx(6e-4, rel=1e-15)  # one product


def test_each_axis_may_have_its_own_factors():
    settings = run_settings({"grid": [0.8, 1, 1.2], "grid_f_max": [0.5, 1.0, 1.5, 2.0]})
    assert settings.f_factors == (0.5, 1.0, 1.5, 2.0)
    assert settings.delta_factors == (0.8, 1.0, 1.2)


def test_options_that_are_none_are_defaults_and_others_win_over_the_file(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text('engine = "equilibrium"\nworkers = 3\nseed = 7\n')
    settings = load_settings(path, {"workers": 5, "seed": None})
    assert (settings.engine, settings.workers, settings.seed) == ("equilibrium", 5, 7)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"acuracy": 0.01}, "acuracy is not a setting: did you mean accuracy?"),
        ({"accuracy": 0}, "accuracy = 0: should be greater than or equal to 0.00001"),
        ({"accuracy": float("nan")}, "accuracy = nan: "),
        ({"engine": "abaqus"}, "engine = 'abaqus': should be 'lammps', 'equilibrium' or 'reference'"),
        ({"workers": 0}, "workers = 0: should be greater than or equal to 1"),
        ({"workers": 1.5}, "workers = 1.5: "),
        ({"seed": -1}, "seed = -1: "),
        ({"grid": [0.9, 1.1]}, "grid = [0.9, 1.1]: "),
        ({"grid": [0.9, 1.1, 1.0]}, "must increase from entry to entry"),
        ({"grid": [-1.0, 1.0, 1.1]}, "should be greater than 0"),
        ({"radius_mm": -0.3}, "radius_mm = -0.3: "),
        ({"viscoelastic": 1}, "viscoelastic = 1: "),
        ({"slurm_partition": "a;b"}, "slurm_partition = 'a;b': must be a name of SLURM: letters, digits"),
        ({"dask": "head:8786"}, "dask = 'head:8786': must be an address as `dask scheduler` prints it"),
    ],
)
def test_a_refusal_names_key_value_and_rule(options, sentence):
    with pytest.raises(InputError, match=r"^options: ") as error:
        run_settings(options)
    assert sentence in str(error.value)


def test_all_problems_of_a_file_are_listed_with_its_name(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text("workers = 0\nspeed = 3\nseed = 'x'\n")
    with pytest.raises(InputError) as error:
        load_settings(path)
    assert [line.split(":")[0] for line in str(error.value).splitlines()] == ["run.toml"] * 3


def test_missing_and_broken_files_are_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"run\.toml does not exist"):
        load_settings(tmp_path / "run.toml")
    (tmp_path / "run.toml").write_text("engine = lammps")
    with pytest.raises(InputError, match=r"run\.toml cannot be read as TOML"):
        load_settings(tmp_path / "run.toml")


def test_settings_cannot_be_changed():
    with pytest.raises(ValidationError, match="frozen"):
        RunSettings().seed = 3


def test_the_table_names_every_setting():
    rows = settings_table().splitlines()[2:]
    assert [row.split("`")[1] for row in rows] == list(RunSettings.model_fields)
    assert all(field.description for field in RunSettings.model_fields.values())
