"""The report: one HTML file that needs nothing beside it and prints well."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class Number:
    """One row of a table of results.

    Parameters
    ----------
    name : str
    value : str, already rounded and with its unit
    remark : str; interval, comparison, what it is
    """

    name: str
    value: str
    remark: str = ""


@dataclass(frozen=True)
class Figure:
    """A picture with its caption.

    Parameters
    ----------
    png : bytes
    caption : str
    wide : bool; takes the whole width instead of half of it
    """

    png: bytes
    caption: str
    wide: bool = False

    def __post_init__(self) -> None:
        if not self.png.startswith(b"\x89PNG\r\n\x1a\n"):
            raise InputError(f"the figure {self.caption!r} is not a PNG")

    @property
    def source(self) -> str:
        """Data URL."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


@dataclass(frozen=True)
class Section:
    """A part of the report: text, numbers, figures, notes, each optional.

    Parameters
    ----------
    title : str
    text : str; one paragraph
    numbers : sequence of Number
    figures : sequence of Figure
    notes : sequence of str, small print
    """

    title: str
    text: str = ""
    numbers: Sequence[Number] = ()
    figures: Sequence[Figure] = ()
    notes: Sequence[str] = ()


def page(
    title: str,
    sections: Sequence[Section],
    *,
    subtitle: str = "",
    warnings: Sequence[str] = (),
    footer: Sequence[str] = (),
) -> str:
    """The report as one HTML text; every name and text in it is escaped.

    Parameters
    ----------
    title : str
    sections : sequence of Section
    subtitle : str; what was done to what
    warnings : sequence of str; shown before everything else
    footer : sequence of str; version, command, time
    """
    environment = Environment(
        loader=PackageLoader("pipeline.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("report.html.j2")
    return template.render(title=title, subtitle=subtitle, sections=sections, warnings=warnings, footer=footer)
