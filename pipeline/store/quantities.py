"""Types of the numbers in experiment.toml: positive, in the unit of their key, in the range a test can have."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field


def _between(low: float, high: float, unit: str) -> AfterValidator:
    """A positive number inside the range; outside it the unit is wrong, mostly by 1000."""

    def check(value: float) -> float:
        if not value > 0:
            raise ValueError("must be positive")
        if not low <= value <= high:
            raise ValueError(f"lies outside {low:g} to {high:g} {unit}, where every test lies: the key asks for {unit}")
        return value

    return AfterValidator(check)


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ValueError("must be odd: a subset has a centre")
    return value


Size = Annotated[float, _between(1, 5000, "mm")]
Gap = Annotated[float, Field(ge=0, le=1000)]
Radius = Annotated[float, _between(1e-3, 20, "mm")]
Pitch = Annotated[float, _between(1e-5, 10, "mm")]
Opening = Annotated[float, _between(1e-4, 50, "mm")]
OpeningRate = Annotated[float, _between(1e-4, 1e3, "mm/min")]
Scatter = Annotated[float, _between(1e-7, 1, "mm")]
BondOpening = Annotated[float, _between(1e-8, 1e-2, "m")]
Newton = Annotated[float, _between(1e-6, 1e7, "N")]
Gigapascal = Annotated[float, _between(1e-3, 1e3, "GPa")]
Strength = Annotated[float, _between(1e-2, 1e3, "MPa")]
Energy = Annotated[float, _between(1, 1e5, "J/m²")]
Celsius = Annotated[float, Field(ge=-100, le=100)]
Ratio = Annotated[float, Field(gt=0, le=100)]
Poisson = Annotated[float, Field(ge=0, lt=0.5)]
Count = Annotated[int, Field(ge=1, le=1000)]
Subset = Annotated[int, Field(ge=5, le=201), AfterValidator(_odd)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Places = Annotated[tuple[float, ...], Field(strict=False, min_length=1)]
Pixel = Annotated[int, Field(ge=0)]
Pixels = Annotated[int, Field(gt=0)]
Box = Annotated[tuple[Pixel, Pixel, Pixels, Pixels], Field(strict=False)]
Angle = Annotated[float, Field(ge=-360, le=360)]
# no path, no option, no hidden file: it reaches decks and job scripts
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9._-]*$", max_length=100)]
