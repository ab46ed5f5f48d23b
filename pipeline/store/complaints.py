"""What a model refuses, said in plain sentences: file, key, value, rule, remedy."""

from __future__ import annotations

import difflib
import json
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

_TAGS = ("seb", "dct")
_TYPES = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text in quotes",
    "tuple_type": "must be a list in square brackets",
    "finite_number": "must be a finite number",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "string_pattern_mismatch": "may hold letters, digits, dot, dash and underscore only, not . or - first",
    "string_too_long": "is too long",
    "too_short": "has too few entries",
    "too_long": "has too many entries",
}
_BOUNDS = {"ge": "at least", "gt": "larger than", "le": "at most", "lt": "smaller than"}


def sentences(error: ValidationError, file: str, model: type[BaseModel]) -> list[str]:
    """One sentence for each problem of a file read into `model`."""
    return [_sentence(problem, file, model) for problem in error.errors()]


def _sentence(problem: ErrorDetails, file: str, model: type[BaseModel]) -> str:
    where = [part for part in problem["loc"] if part not in _TAGS]
    tables = [part for part in where if isinstance(part, str)]
    key, numbers = tables[-1], "".join(f"[{part}]" for part in where if isinstance(part, int))
    table = f"[{'.'.join(tables[:-1])}] " if len(tables) > 1 else ""
    kind = problem["type"]
    if kind == "missing":
        return f"{file}: {table}{key} is missing: add it{_about(problem, model)}"
    if kind == "extra_forbidden":
        return f"{file}: {table}{key} is not a key of this file: {_nearest(problem, model)}"
    if kind.startswith("union_tag"):
        return f'{file}: [{".".join(tables)}] geometry must be "seb" or "dct"{_got(problem)}'
    return f"{file}: {table}{key}{numbers} = {_shown(problem['input'])} {_rule(problem)}"


def _rule(problem: ErrorDetails) -> str:
    """What the value must be."""
    kind, context = problem["type"], problem.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        return f"must be {context['expected']}"
    for bound, words in _BOUNDS.items():
        if bound in context:
            return f"must be {words} {context[bound]:g}"
    return _TYPES.get(kind, problem["msg"][0].lower() + problem["msg"][1:])


def _got(problem: ErrorDetails) -> str:
    raw = problem["input"]
    return f", not {_shown(raw['geometry'])}" if isinstance(raw, dict) and "geometry" in raw else ""


def _about(problem: ErrorDetails, model: type[BaseModel]) -> str:
    """The description of a missing key, where it has one."""
    field = _fields(problem, model).get(str(problem["loc"][-1]))
    return f" ({field.description})" if field and field.description else ""


def _nearest(problem: ErrorDetails, model: type[BaseModel]) -> str:
    """The key that was probably meant."""
    meant = difflib.get_close_matches(str(problem["loc"][-1]), list(_fields(problem, model)), n=1)
    return f"did you mean {meant[0]}?" if meant else "remove it"


def _fields(problem: ErrorDetails, model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The keys of the table in which the problem lies."""
    owners = [model]
    for part in problem["loc"][:-1]:
        if part in _TAGS:
            owners = [o for o in owners if o.__name__.lower().startswith(str(part))]
        else:
            inside = [o.model_fields[str(part)].annotation for o in owners if part in o.model_fields]
            owners = [m for annotation in inside for m in _models(annotation)]
    return {key: field for owner in owners for key, field in owner.model_fields.items()}


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The models a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for inner in getattr(annotation, "__args__", ()) for m in _models(inner)]


def _shown(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=False)  # a line break must not break the message
    else:
        text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
