"""The reference values in LAMMPS' own form: files and style must agree, newton on and off."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from .force_styles import regenerate

EPSILON = 1e-11  # of the files; displacements of 4e-6 m carry round-off of 1e-19 m of 6e-4 m


def block(text: str, key: str) -> np.ndarray:
    """The numbers under a key."""
    found = re.search(rf"^{key}:(?: ! \|2-?)?\s(.*?)(?=^\S)", text, re.MULTILINE | re.DOTALL)
    assert found, key
    return np.array(found.group(1).split(), float)


@pytest.mark.parametrize("name", regenerate.CASES)
def test_the_files_are_what_the_style_gives(name: str) -> None:
    text = (Path(regenerate.HERE) / f"{name}.yaml").read_text(encoding="ascii")
    found = regenerate.values(*regenerate.CASES[name])
    for when in ("init", "run"):
        forces = block(text, f"{when}_forces").reshape(-1, 4)[:, 1:]
        assert len(forces) == found["natoms"]
        scale = np.abs(forces).max()
        assert scale > 1, "the bonds must pull"
        assert found[f"{when}_forces"] == pytest.approx(forces, abs=EPSILON * scale)
        assert found[f"{when}_energy"] == pytest.approx(block(text, f"{when}_energy")[0], rel=EPSILON)
        stress = block(text, f"{when}_stress")
        assert found[f"{when}_stress"] == pytest.approx(stress, abs=EPSILON * np.abs(stress).max())
