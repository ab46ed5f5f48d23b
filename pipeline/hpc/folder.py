"""Writing a study: points, scripts, sources of the style, manifest."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from string import Template

from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.core.problem import Problem, Solution
from pipeline.hpc.checksums import changed, checksum_list, checksums, read_checksum_list, sha256
from pipeline.hpc.manifest import FILE, Manifest, Point, manifest_text, read_manifest
from pipeline.lmp import simulate
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.stock import STOCK_DECK, read_stock_solution, solve_stock, write_stock_deck

INPUTS = "inputs.sha256"
PLAIN = ("environment", "submit.slurm", "README.md")  # meant to be edited: not in the manifest
BEGUN = "unfinished-study.txt"  # marks what an export that was stopped has left
SECONDS = 30.0  # between restart files, on one core
PER_BOND = 5e-9  # s of a core a bond and step, measured (scripts/benchmark_scale.py)


@dataclass(frozen=True)
class Job:
    """How SLURM is asked; names are checked by the settings of the run.

    Parameters
    ----------
    ranks : int; MPI ranks of one point
    walltime_min : int
    array_limit : int or None; points at a time
    partition, account : str or None
    """

    ranks: int = 1
    walltime_min: int = 60
    array_limit: int | None = None
    partition: str | None = None
    account: str | None = None


@dataclass(frozen=True)
class Variant:
    """A kind of deck: name in the manifest, file, the LAMMPS it needs, how it is written, read back and run here."""

    name: str
    deck: str
    packages: str
    versions: dict[str, str]
    write: Callable[[Path, Problem, int], object]
    read: Callable[[Problem, Path, float], Solution]
    solve: Callable[[Problem], Solution] | None = None  # None: as the engine does


def _stock(kind: str, packages: str, versions: dict[str, str]) -> Variant:
    write, solve = partial(write_stock_deck, kind=kind), partial(solve_stock, kind=kind)
    return Variant(kind, STOCK_DECK, packages, versions, write, read_stock_solution, solve)


TESTED, UNTESTED, OLD = "tested", "not tested", "too old"
VARIANTS = {
    "cohesive": Variant(
        "cohesive",
        DECK,
        "MOLECULE and PLUGIN (or the style built in)",
        {"22 Jul 2025": TESTED, "later ones": UNTESTED, "29 Aug 2024": OLD},
        write_deck,
        simulate.read_solution,
    ),
    "table": _stock("table", "MOLECULE", {"22 Jul 2025": TESTED, "29 Aug 2024": TESTED, "2 Aug 2023": OLD}),
    "plastic": _stock(
        "plastic", "MOLECULE and BPM", {"22 Jul 2025": TESTED, "2 Apr 2025": UNTESTED, "4 Feb 2025": OLD}
    ),
}


def default_stretch(problem: Problem, ranks: int) -> int:
    """Steps between restart files that take about `SECONDS`."""
    return max(1000, int(SECONDS * ranks / (PER_BOND * problem.bonds.count)))


def stretch_of(out: Path, wanted: int | None, problem: Problem, ranks: int) -> int:
    """Steps between restart files: as wanted, as of the decks that lie in OUT already, or `default_stretch`.

    Raises
    ------
    InputError
        where those decks have another stretch than the one that is wanted
    """
    asked = wanted or default_stretch(problem, ranks)
    deck = next((out / "points").glob("*/settings.inc"), None)
    if deck is None:
        return asked
    held = dict(re.findall(r"^variable (\w+) index (\d+)$", deck.read_text("ascii"), re.MULTILINE))
    stretch, record = int(held["stretch"]), int(held["record"])
    if asked <= stretch < asked + record:  # decks round up to a multiple of their records
        return asked
    if wanted:
        told = f"the decks in {out} write restart files every {stretch} steps, not every {wanted}"
        raise InputError(f"{told}: leave --restart-steps out, or export into another folder")
    return stretch


def begin_study(out: Path) -> None:
    """Make OUT for a study and mark it as begun; refuse a folder that holds anything else.

    Raises
    ------
    InputError
        naming a file that is in the way
    """
    held = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
    if held and FILE not in held and BEGUN not in held:
        raise InputError(f"{out} holds other files, {held[0]} for one: export into a folder of its own")
    out.mkdir(parents=True, exist_ok=True)
    if FILE not in held:
        _write(out / BEGUN, "an export that was not finished: the same command goes through it again\n")


def refuse_another(out: Path, study: str) -> None:
    """Refuse a folder that holds another study; what an export that was stopped has left of points goes.

    Raises
    ------
    InputError
        naming both
    """
    try:
        held = read_manifest(out).study
    except MissingFileError:
        shutil.rmtree(out / "points", ignore_errors=True)
        return
    if held != study:
        raise InputError(f"{out} holds another study ({held[:8]}): choose another folder for this one ({study[:8]})")


def write_points(
    out: Path, study: str, points: Sequence[Point], problems: Sequence[Problem], variant: Variant, stretch: int
) -> tuple[Point, ...]:
    """Write the folders of points that are not there; the points with the checksums of their inputs."""
    first: dict[str, Path] = {}
    return tuple(
        _write_point(out, study, point, problem, variant, stretch, first)
        for point, problem in zip(points, problems, strict=True)
    )


def _write_point(
    out: Path, study: str, point: Point, problem: Problem, variant: Variant, stretch: int, first: dict[str, Path]
) -> Point:
    folder = out / point.folder
    title = f"study {study} point {point.number} key {point.key}"
    if _is_whole(folder, title):
        for name, digest in read_checksum_list((folder / INPUTS).read_text("ascii")).items():
            first.setdefault(digest, folder / name)
        return replace(point, inputs=sha256(folder / INPUTS))
    draft = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    variant.write(draft, problem, stretch)
    digests = checksums(draft, [path.name for path in draft.iterdir()])
    for name, digest in digests.items():
        if digest in first:
            _share(draft / name, first[digest])
    (draft / INPUTS).write_text(checksum_list(digests, title), encoding="ascii")
    _put(draft, folder)
    for name, digest in digests.items():
        first.setdefault(digest, folder / name)
    return replace(point, inputs=sha256(folder / INPUTS))


def _is_whole(folder: Path, title: str) -> bool:
    """Whether a point has the inputs that were written for it, unchanged."""
    if not (folder / INPUTS).is_file():
        return False
    text = (folder / INPUTS).read_text(errors="replace")
    return text.startswith(f"# {title}\n") and not changed(folder, read_checksum_list(text))


def _put(draft: Path, folder: Path) -> None:
    """Let a draft be the folder of a point; what was run from the very same inputs stays."""
    if (folder / INPUTS).is_file() and sha256(folder / INPUTS) == sha256(draft / INPUTS):
        for path in draft.iterdir():
            path.replace(folder / path.name)
        draft.rmdir()
        return
    shutil.rmtree(folder, ignore_errors=True)
    draft.rename(folder)


def _share(path: Path, first: Path) -> None:
    """Let a file that equals one of an earlier point be the same on disk."""
    path.unlink()
    try:
        os.link(first, path)
    except OSError:  # a file system without hard links
        shutil.copyfile(first, path)


def write_scripts(out: Path, manifest: Manifest, variant: Variant, job: Job, stretch: int) -> None:
    """Write run-point, environment, the SLURM script, the style and README."""
    with as_file(files("pipeline.hpc") / "files") as source:
        _write(out / "run-point", (source / "run-point").read_text().replace("DECK", variant.deck), executable=True)
        if not (out / "environment").exists():
            _write(out / "environment", (source / "environment").read_text())
        values = _job_words(manifest, job)
        _write(out / "submit.slurm", Template((source / "submit.slurm").read_text()).substitute(values))
        values = _readme_words(manifest, variant, stretch)
        _write(out / "README.md", Template((source / "README.md").read_text("utf-8")).substitute(values))
        if variant.name == "cohesive":
            _write_style(out / "style", source / "style")


def finish_study(out: Path, manifest: Manifest) -> None:
    """Write the manifest, last: it says that the study is whole."""
    places = [out / "run-point", *(out / "style").rglob("*"), *(out / "bundle").rglob("*")]
    names = [str(path.relative_to(out)) for path in places if path.is_file()]
    own = [
        name
        for name in names
        if name not in (FILE, BEGUN, *PLAIN) and not name.startswith(("result", "slurm-", "report"))
    ]
    complete = replace(manifest, files=checksums(out, [name for name in own if not name.endswith((".so", ".png"))]))
    part = out / f".{FILE}.part"
    part.write_text(manifest_text(complete), encoding="utf-8")
    part.replace(out / FILE)
    (out / BEGUN).unlink(missing_ok=True)


def _write(path: Path, text: str, executable: bool = False) -> None:
    path.write_text(text, encoding="utf-8")
    if executable:
        path.chmod(0o755)


def _write_style(out: Path, source: Path) -> None:
    out.mkdir(exist_ok=True)
    with as_file(files("pipeline.lmp") / "cpp") as sources:
        if not sources.is_dir():
            raise StoreError(f"{sources} does not exist: install the package again")
        for path in [*sorted(sources.glob("*.h")), *sorted(sources.glob("*.cpp")), *sorted(source.iterdir())]:
            shutil.copyfile(path, out / path.name)


def _job_words(manifest: Manifest, job: Job) -> dict[str, object]:
    last = len(manifest.points) - 1
    given = {"partition": job.partition, "account": job.account}
    return {
        "study": manifest.study[:8],
        "array": f"0-{last}" + (f"%{job.array_limit}" if job.array_limit else ""),
        "ranks": job.ranks,
        # a launcher that `environment` names wins
        "launcher": "export LAUNCHER=srun\n" if job.ranks > 1 else "",
        "walltime": job.walltime_min,
        # time for LAMMPS to be ended and the task to be queued again; SLURM may be a minute early
        "lead": max(5, min(120, 6 * job.walltime_min)),
        "options": "\n".join(f"#SBATCH --{name}={value}" for name, value in given.items() if value),
    }


def _readme_words(manifest: Manifest, variant: Variant, stretch: int) -> dict[str, object]:
    style = "Compile the bond style: `sh style/build SOURCE` (`head style/build` says what SOURCE may be)."
    stock = "Nothing to compile: the stock approximation needs no bond style of ours."
    return {
        "count": len(manifest.points),
        "last": len(manifest.points) - 1,
        "version": manifest.version,
        "first": style if variant.name == "cohesive" else stock,
        "stretch": stretch,
        "packages": variant.packages,
        "versions": ", ".join(f"{name} ({state})" for name, state in manifest.lammps.items()),
    }
