"""The commands `cohesive-bpm library …`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pipeline.options import Debug, Geometry, Out, TemperatureRange, option
from pipeline.terminal import exit_codes, finish

library = typer.Typer(no_args_is_help=True, help="Identified mixtures, kept and compared.")

LibraryFile = Annotated[Path, typer.Argument(metavar="LIBRARY", help="HDF5 file of identified mixtures.")]
Mixture = Annotated[str | None, option("--mixture", metavar="NAME", help="Entries of this mixture only.")]
OfGeometry = Annotated[Geometry | None, option("--geometry", help="Entries of this specimen only.")]
Key = Annotated[str | None, option("--key", metavar="KEY", help="This entry only; its first letters will do.")]


def meant(mixture: str | None, geometry: str | None, key: str | None, temperatures: Any) -> Any:
    """The filter of the options."""
    from pipeline.store.library import Filter

    return Filter(mixture, geometry, key, temperatures)


@library.command()
def add(
    file: LibraryFile,
    results: Annotated[list[Path], typer.Argument(metavar="OUT...", help="Folders with results of identify.")],
    mixture: Annotated[str, option("--mixture", metavar="NAME", help="What was tested; the same for its replicates.")],
    note: Annotated[str, option("--note", metavar="TEXT", help="A remark.")] = "",
    anyway: Annotated[bool, option("--anyway", help="Keep also an estimate that was not accepted.")] = False,
    debug: Debug = False,
) -> None:
    """Keep results of identify under the name of a mixture; all of them or none."""
    with exit_codes(debug):
        from pipeline.study import library as study

        finish(study.add(file, results, mixture, note, anyway=anyway), file)


@library.command("list")
def show(
    file: LibraryFile,
    mixture: Mixture = None,
    geometry: OfGeometry = None,
    key: Key = None,
    temperatures_c: TemperatureRange = None,
    debug: Debug = False,
) -> None:
    """Show the entries as a table."""
    with exit_codes(debug):
        from pipeline.study import library as study

        print(study.show(file, meant(mixture, geometry, key, temperatures_c)), flush=True)


@library.command()
def export(
    file: LibraryFile,
    table: Annotated[Path, typer.Argument(metavar="FILE.csv", help="Table to write.")],
    mixture: Mixture = None,
    geometry: OfGeometry = None,
    key: Key = None,
    temperatures_c: TemperatureRange = None,
    debug: Debug = False,
) -> None:
    """Write the entries as a CSV table."""
    with exit_codes(debug):
        from pipeline.study import library as study

        finish(study.export(file, table, meant(mixture, geometry, key, temperatures_c)), table)


@library.command()
def compare(
    file: LibraryFile,
    out: Out,
    mixture: Mixture = None,
    geometry: OfGeometry = None,
    key: Key = None,
    temperatures_c: TemperatureRange = None,
    debug: Debug = False,
) -> None:
    """Compare entries: ratios, chances, replicates, figures."""
    with exit_codes(debug):
        from pipeline.study.comparison import compare as side_by_side

        finish(side_by_side(file, out, meant(mixture, geometry, key, temperatures_c)), out)


@library.command()
def start(
    file: LibraryFile,
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Bundle whose [start] is written.")],
    mixture: Mixture = None,
    geometry: OfGeometry = None,
    key: Key = None,
    debug: Debug = False,
) -> None:
    """Write the start of a bundle's search from the entry nearest in temperature."""
    with exit_codes(debug):
        from pipeline.study import library as study

        finish(study.start(file, bundle, meant(mixture, geometry, key, None)), bundle)


@library.command()
def remove(
    file: LibraryFile,
    key: Annotated[str, typer.Argument(metavar="KEY", help="Key of the entry; its first letters will do.")],
    debug: Debug = False,
) -> None:
    """Take one entry out."""
    with exit_codes(debug):
        from pipeline.study import library as study

        finish(study.remove(file, key), file)
