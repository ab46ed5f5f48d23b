#!/usr/bin/env python3
"""Write the tables of docs/*.md anew, each between `<!-- table: NAME -->` and `<!-- end -->`, from the code itself."""

import re
from pathlib import Path
from typing import get_args

from pydantic import BaseModel

from pipeline.config import settings_table
from pipeline.store import experiment, layouts, toml_text

DOCS = Path(__file__).resolve().parents[1] / "docs"
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
UNITS = {"mm_per_min": "mm/min", "mm_per_px": "mm/px", "j_per_m2": "J/m²", "gpa": "GPa", "mpa": "MPa", "deg": "°"}
UNITS |= {"mm": "mm", "px": "px", "c": "°C", "s": "s", "n": "N", "m": "m"}  # by the end of a key, the longest first


def keys(model: type[BaseModel], path: str, note: str) -> list[str]:
    """A table of experiment.toml as Markdown, its keys with unit, default and meaning, then the tables in it."""
    text, inner = f"**`{path}`** {note}\n\n| key | unit | default | meaning |\n|---|---|---|---|\n", []
    for key, field in model.model_fields.items():
        parts = get_args(field.annotation) or [field.annotation]
        tables = [kind for kind in parts if isinstance(kind, type) and issubclass(kind, BaseModel)]
        for kind in tables:
            inner += keys(kind, f"{path}.{key}".removeprefix("top."), field.description or str(kind.__doc__))
        unit = next((unit for end, unit in UNITS.items() if f"_{key}".endswith(f"_{end}")), "")
        value = "required" if field.is_required() else f"`{toml_text.toml_value(field.default)}`"
        choices = " or ".join(f"`{toml_text.toml_value(c)}`" for c in parts if isinstance(c, str | int))
        cells = f"`{key}`", unit, value.replace("`None`", ""), "; ".join(filter(None, [choices, field.description]))
        text += "" if tables else f"| {' | '.join(cells)} |\n"
    return list(dict.fromkeys([text, *inner]))


TABLES = {name.lower(): kind.table for name, kind in vars(layouts).items() if isinstance(kind, layouts.Layout)}
TABLES |= {"settings": settings_table, "experiment": lambda: "\n".join(keys(experiment.Experiment, "top", "keys"))}

if __name__ == "__main__":
    for page in sorted(DOCS.glob("*.md")):
        page.write_text(BLOCK.sub(lambda m: f"{m[1]}\n{TABLES[m[2]]().strip()}\n\n{m[3]}", page.read_text("utf-8")))
