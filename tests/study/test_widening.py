"""Further parameters through the whole chain: a modulus stated wrongly is found beside f_max and delta_max."""

from __future__ import annotations

import json

import pytest
from helpers.bundles import DELTA_MAX, F_MAX, edit, make_bundle

from pipeline.config import load_settings, run_settings
from pipeline.core.errors import InputError
from pipeline.study.identify import identify

WRONG = 9.5  # GPa; the truth is 10


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    folder = make_bundle(tmp_path_factory.mktemp("bundles") / "wrong-modulus")
    edit(folder, mastic_modulus_gpa=str(WRONG))
    return folder


def settings(folder, *names):
    file = folder / "more.toml"
    file.write_text(f"more_parameters = {json.dumps(names)}\n", "utf-8")
    return file


@pytest.mark.slow
def test_a_wrong_modulus_is_found_with_the_two_others(bundle, tmp_path):
    grid = (0.9, 1.0, 1.1)
    told = identify(
        bundle, tmp_path / "out", objective="both", grid=grid, placements=0, config=settings(tmp_path, "mastic_modulus")
    )
    more = json.loads((tmp_path / "out" / "result.json").read_text("utf-8"))["more_parameters"]
    assert more["simulations"] == 25
    assert all(more["determined"].values())
    values = more["values"]
    assert values["mastic_modulus_pa"] == pytest.approx(10e9, rel=0.01)  # one stone does not follow; paths change
    assert values["f_max_n"] == pytest.approx(F_MAX, rel=0.02)
    assert values["delta_max_m"] == pytest.approx(DELTA_MAX, rel=0.03)
    low, high = more["interval_95"]["mastic_modulus_pa"]
    assert low < 10e9 < high
    assert "together with more parameters: f_max = " in told


@pytest.mark.parametrize(
    ("names", "aim", "said"),
    [
        (("mastic_modulus",), "fields", "cannot be found from fields alone"),
        (("shear_strength_ratio",), "both", "bonds carry no shear"),
    ],
)
def test_what_the_test_cannot_feel_is_refused_before_anything_runs(bundle, tmp_path, names, aim, said):
    with pytest.raises(InputError, match=said):
        identify(bundle, tmp_path / "out", objective=aim, config=settings(tmp_path, *names))
    assert not list((tmp_path / "out").glob("simulations/*"))


def test_names_are_checked(tmp_path):
    with pytest.raises(InputError, match="must name each parameter once"):
        load_settings(settings(tmp_path, "mastic_modulus", "mastic_modulus"))
    with pytest.raises(InputError, match="more_parameters"):
        run_settings({"more_parameters": ("colour",)})
    three = ("mastic_modulus", "interface_strength_ratio", "interface_opening_ratio")
    with pytest.raises(InputError, match="more_parameters"):
        run_settings({"more_parameters": three})
