"""The floors of the house, read from the source: imports go down only; rooms on one floor do not know each other."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

FLOORS = {
    1: {"core"},
    2: {"materials", "microstructure", "dic", "inverse", "explicit"},
    3: {"gap"},
    4: {"lmp", "reference", "equilibrium", "twin", "blind"},
    5: {"store", "config", "report", "execution", "hpc"},
    6: {"study"},
    7: {"cli", "cli_blind_check", "cli_cluster", "cli_diagnose", "cli_library", "options", "terminal", "__main__"},
}
ROOMS = {room: floor for floor, rooms in FLOORS.items() for room in rooms}
FACE = {
    "cli",
    "cli_blind_check",
    "cli_cluster",
    "cli_diagnose",
    "cli_library",
    "options",
    "terminal",
    "__main__",
}  # one room in several files
BLIND = {("study", "blind_check")}  # the only ones who may know the engine of the blind check

# written so that this file does not contain what it looks for
PLACES = re.compile(
    r"(?<![\w.~$}/-])/(?:root|home|work|opt|mnt|tmp|Users)/(?!\.\.\.)[\w.]"
    r"|py[p]i\.org|python[h]osted|npm[j]s\.|deb\.deb[i]an\.org|arch[i]ve\.ubuntu|conda\.anac[o]nda"
)


def imports(source: str, module: str) -> Iterator[tuple[int, str]]:
    """Line and absolute name of everything that the source of `module` imports, in functions too."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = module.split(".")[: -node.level] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{name}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from ((node.lineno, a.value) for a in node.args if isinstance(a, ast.Constant))


def room_of(name: str) -> str | None:
    """The room of an absolute name; None outside the package, "" for the package itself."""
    parts = [*name.split("."), ""]
    return parts[1] if parts[0] == "pipeline" else None


def complaints(source: str, module: str) -> list[str]:
    """What the source of `module` imports against the rules."""
    mine = room_of(module) or ""
    found = []
    for line, name in imports(source, module):
        other = room_of(name)
        rule = third_party_rule(mine, name) if other is None else floor_rule(module, mine, other)
        if rule:
            found.append(f"{module}, line {line}: {name}: {rule}")
    return found


def third_party_rule(mine: str, name: str) -> str | None:
    """Why `mine` may not import a name from outside the package."""
    top = name.split(".")[0]
    if mine == "core" and top not in sys.stdlib_module_names | {"numpy"}:
        return "core imports NumPy only"
    return None


def floor_rule(module: str, mine: str, other: str) -> str | None:
    """Why the room `mine` may not import from the room `other`."""
    if other not in ROOMS:
        return None if other.startswith("__") or other == "" else f"{other} is no room of the house: give it a floor"
    if mine == other or {mine, other} <= FACE:
        return None
    if other == "blind" and tuple(module.split(".")[1:3]) not in BLIND:
        return "only the blind check knows its engine"
    if mine == "__init__":
        return "the package itself imports no room"
    if ROOMS[mine] == ROOMS[other]:
        return f"{mine} and {other} share floor {ROOMS[mine]}"
    return f"floor {ROOMS[mine]} imports from floor {ROOMS[other]}" if ROOMS[mine] < ROOMS[other] else None


def modules() -> list[tuple[str, Path]]:
    """Dotted name and file of every module of the checkout; a package is named by its __init__."""
    files = sorted((ROOT / "pipeline").rglob("*.py"))
    return [(".".join(path.relative_to(ROOT).with_suffix("").parts), path) for path in files]


def tracked() -> list[Path]:
    """Files of the project that hold text of ours."""
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        pytest.skip("not a git checkout: there is no list of the project's files")
    files = [ROOT / name for name in listing.stdout.split("\0") if name]
    return [path for path in files if path.is_file() and path != Path(__file__).resolve()]


def test_every_room_has_a_floor():
    rooms = {room_of(name) for name, _ in modules()} - {"__init__"}
    assert rooms <= set(ROOMS), f"rooms without a floor: {sorted(str(r) for r in rooms - set(ROOMS))}"


def test_imports_go_down_only():
    found = [text for name, path in modules() for text in complaints(path.read_text(encoding="utf-8"), name)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("module", "source", "rule"),
    [
        ("pipeline.core.field", "import scipy.sparse", "NumPy only"),
        ("pipeline.core.field", "from pipeline.dic import subset", "floor 1 imports from floor 2"),
        ("pipeline.lmp.deck", "from pipeline.store.results import x", "floor 4 imports from floor 5"),
        ("pipeline.lmp.deck", "def f():\n    from pipeline import twin", "share floor 4"),
        ("pipeline.store.bundle", "import pipeline.config", "share floor 5"),
        ("pipeline.dic.track", "from ..inverse import newton", "share floor 2"),
        ("pipeline.gap.score", "from importlib import import_module\nimport_module('pipeline.lmp')", "floor 3"),
        ("pipeline.study.diagnose", "from pipeline.blind import engine", "only the blind check"),
        ("pipeline.study.identify", "from pipeline.helpers import x", "no room"),
        ("pipeline.__init__", "from pipeline.core import units", "imports no room"),
    ],
)
def test_the_guard_sees_what_is_wrong(module, source, rule):
    assert [text for text in complaints(source, module) if rule in text]


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("pipeline.core.field", "import numpy as np\nfrom pipeline.core.units import MM\nimport math"),
        ("pipeline.lmp.deck", "from pipeline.core import units\nfrom . import data_file"),
        ("pipeline.study.blind_check", "from pipeline.blind import engine"),
        ("pipeline.cli", "from pipeline import __version__, terminal"),
        ("pipeline.cli", "from pipeline.study import identify\nimport typer"),
    ],
)
def test_the_guard_lets_pass_what_is_right(module, source):
    assert complaints(source, module) == []


def test_no_file_names_a_place_of_one_machine():
    found = []
    for path in tracked():
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            continue  # a picture or an array
        found += [
            f"{path.relative_to(ROOT)}:{n}: {line.strip()}" for n, line in enumerate(lines, 1) if PLACES.search(line)
        ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("text", ["cd /ro" + "ot/x", "open('/tm" + "p/a')", "https://pyp" + "i.org/simple"])
def test_places_are_seen(text):
    assert PLACES.search(text)


@pytest.mark.parametrize("text", ["GPL/home", "a/tmp/b", "../shared/data", "${DIR}/opt/x", "/dev/null", "/usr/bin/env"])
def test_what_is_no_place_is_let_pass(text):
    assert not PLACES.search(text)
