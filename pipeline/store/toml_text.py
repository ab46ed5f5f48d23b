"""experiment.toml as text, every key with its comment; what is not set stands there commented out."""

from __future__ import annotations

import json
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pipeline.store.experiment import Experiment

COLUMN = 40  # where comments begin
HEAD = "# A bundle of cohesive-bpm: units stand in the keys; lines that begin with # are not set.\n"


def toml_text(experiment: Experiment) -> str:
    """The whole file; reading it gives the same experiment."""
    plain = [_line(k, getattr(experiment, k), f) for k, f in Experiment.model_fields.items() if not _models(f)]
    tables = [_table(k, getattr(experiment, k), f) for k, f in Experiment.model_fields.items() if _models(f)]
    return HEAD + "\n".join([*plain, *(line for table in tables for line in ["", *table])]) + "\n"


def _table(name: str, section: BaseModel | None, field: FieldInfo) -> list[str]:
    """The lines of one table and of those inside it."""
    kind = type(section) if section is not None else _models(field)[0]
    lines = [_commented(f"[{name}]" if section is not None else f"# [{name}]", field.description or "")]
    nested = []
    for key, inner in kind.model_fields.items():
        value = getattr(section, key) if section is not None else None
        if _models(inner):
            nested += _table(f"{name}.{key}", value, inner)
        else:
            lines.append(_line(key, value, inner))
    return lines + nested


def _line(key: str, value: Any, field: FieldInfo) -> str:
    """One key with its value, or commented out with an example or its default."""
    if value is not None:
        return _commented(f"{key} = {toml_value(value)}", _comment(field))
    return _commented(
        f"# {key} = {toml_value(field.examples[0] if field.examples else field.default)}", _comment(field)
    )


def _commented(text: str, comment: str) -> str:
    return f"{text:<{COLUMN}}# {comment}" if comment else text


def _comment(field: FieldInfo) -> str:
    """Choices and description."""
    kind = field.annotation
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    shown = " | ".join(map(toml_value, choices)) if len(choices) > 1 else ""
    return "; ".join(part for part in (shown, field.description or "") if part)


def toml_value(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def _models(field: FieldInfo) -> list[type[BaseModel]]:
    """The tables that a field may hold."""
    kinds = get_args(field.annotation) or (field.annotation,)
    return [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]
