"""experiment.toml as one frozen model: read, judged section by section, written with its comments."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from pipeline.core.errors import BundleError, InputError, MissingFileError
from pipeline.store.complaints import sentences
from pipeline.store.quantities import Name
from pipeline.store.sections import (
    DctSection,
    DicSection,
    LoadingSection,
    MaterialSection,
    ModelSection,
    NoiseSection,
    ObservationSection,
    PixelFrame,
    SebSection,
    Section,
    StartSection,
)

FILE = "experiment.toml"


class Experiment(Section):
    """The whole experiment.toml."""

    format: Literal[1] = Field(description="of this file")
    name: Name = Field(examples=["seb-07"], description="letters, digits, dot, dash and underscore only")
    specimen: Annotated[SebSection | DctSection, Field(discriminator="geometry")]
    loading: LoadingSection
    camera: PixelFrame | None = Field(default=None, description="for images/")
    dic: DicSection = Field(default=DicSection(), description="image correlation; optional")
    noise: NoiseSection = Field(default=NoiseSection(), description="optional; estimated where absent")
    material: MaterialSection
    model: ModelSection = Field(default=ModelSection(), description="optional; defaults as here")
    start: StartSection | None = Field(
        default=None, description="optional: centre of the parameter grid (wins over measured strength and energy)"
    )
    observation: ObservationSection = Field(
        default=ObservationSection(), description="optional; the paper's choice as default"
    )


def read_toml(path: Path) -> dict[str, Any]:
    """The raw tables of a TOML file; refuses what is missing, not UTF-8 or not TOML."""
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise MissingFileError(f"{path.name} is missing in {path.parent}") from None
    except OSError as error:
        raise InputError(f"{path.name} cannot be read ({error.strerror}): check {path}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text (byte {error.start}): save it as UTF-8") from None
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits, brackets nested as deep
        raise InputError(f"{path.name} is not valid TOML: {error}") from None


def parse_experiment(raw: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The sections that are in order, by name, and one sentence for each thing that is not.

    Sections are judged one by one, so that a slip in one of them hides nothing in the others.
    """
    try:
        return dict(Experiment.model_validate(raw)), []
    except ValidationError as error:
        bad = {problem["loc"][0] for problem in error.errors()}
        sound = {n: _alone(f, raw, n) for n, f in Experiment.model_fields.items() if n not in bad}
        return sound, sentences(error, FILE, Experiment)


def _alone(field: FieldInfo, raw: dict[str, Any], name: str) -> Any:
    """One section by itself, or its default."""
    if name not in raw:
        return field.get_default(call_default_factory=True, validated_data={})
    kind: Any = Annotated[field.annotation, field]
    return TypeAdapter(kind).validate_python(raw[name])


def read_experiment(path: Path) -> Experiment:
    """experiment.toml alone, without the files around it; refuses with every problem at once."""
    sections, problems = parse_experiment(read_toml(path))
    if problems:
        raise BundleError(problems)
    return Experiment.model_construct(**sections)
