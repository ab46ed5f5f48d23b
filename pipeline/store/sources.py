"""Which files a bundle consists of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.store import creep, frames, load_cmod

PHOTOGRAPHS = ("specimen.png", "specimen.tif", "specimen.tiff")
LABELS, FIELDS = "labels.png", "fields.h5"
STEMS = ("specimen", "labels")  # under which a picture is taken for one of the specimen
PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".gif", ".webp", ".jp2")


@dataclass(frozen=True)
class Sources:
    """The files that are there; None or empty where a part is not."""

    photograph: Path | None
    labels: Path | None
    images: tuple[Path, ...]
    frames: Path | None
    fields: Path | None
    curve: Path | None
    creep: Path | None


def find_sources(folder: Path, fields: Path | None = None) -> tuple[Sources, list[str]]:
    """The files of a bundle, and one sentence for each that contradicts another or is missing.

    Parameters
    ----------
    folder : Path
    fields : Path; a field file given by the user: stands in for the bundle's own fields or images
    """
    photographs = [folder / name for name in PHOTOGRAPHS if (folder / name).is_file()]
    labels, own = _file(folder, LABELS), _file(folder, FIELDS)
    pictures = folder / frames.FOLDER
    images = frames.image_files(pictures) if pictures.is_dir() and fields is None else ()
    problems = _surface_problems(photographs, labels) + _kind_problems(folder)
    if fields is None:
        problems += _motion_problems(folder, pictures.is_dir(), len(images), own)
    sources = Sources(
        photograph=photographs[0] if photographs else None,
        labels=labels,
        images=images,
        frames=_file(folder, frames.FILE),
        fields=fields or own,
        curve=_file(folder, load_cmod.FILE),
        creep=_file(folder, creep.FILE),
    )
    return sources, problems


def _file(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if path.is_file() else None


def _kind_problems(folder: Path) -> list[str]:
    """A folder where a file should be, a specimen's image in a format that is not read: else silently left out."""
    surfaces = (*PHOTOGRAPHS, LABELS)
    names = (*surfaces, FIELDS, frames.FILE, load_cmod.FILE, creep.FILE)
    folders = (name for name in names if (folder / name).exists() and not _file(folder, name))
    pictures = (p.name for p in sorted(folder.iterdir()) if p.stem.lower() in STEMS and p.suffix.lower() in PICTURES)
    wanted = ", ".join(surfaces)
    return [f"{name}: is not a file: move it away" for name in folders] + [
        f"{name}: is not read, an image of the specimen is one of {wanted}: convert or rename it"
        for name in pictures
        if name not in surfaces
    ]


def _surface_problems(photographs: list[Path], labels: Path | None) -> list[str]:
    """Two sources for the phases of the specimen."""
    names = [path.name for path in photographs] + ([labels.name] if labels else [])
    if len(names) < 2:
        return []
    return [f"{' and '.join(names)}: all say what the specimen is made of: keep one of them"]


def _motion_problems(folder: Path, pictures: bool, count: int, own: Path | None) -> list[str]:
    """Two sources for the displacements, or half a one."""
    table = (folder / frames.FILE).is_file()
    rules = (
        (
            pictures and own is not None,
            f"{frames.FOLDER}/ and {FIELDS}: both give displacements: keep one, or choose with --fields FILE",
        ),
        (pictures and not count, f"{frames.FOLDER}/: holds no PNG or TIFF image: add the speckle images"),
        (bool(count) and not table, f"{frames.FILE}: is missing: {frames.FOLDER}/ needs it (frame,time_s)"),
        (
            table and not pictures and own is None,
            f"{frames.FILE}: is there, {frames.FOLDER}/ is not: add the images",
        ),
    )
    return [sentence for broken, sentence in rules if broken]
