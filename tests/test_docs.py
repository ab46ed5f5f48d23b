"""The documentation: its tables are those of the code, its links lead somewhere, its command lines parse."""

from __future__ import annotations

import ast
import inspect
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import typer

from pipeline.cli import app
from pipeline.equilibrium.path import Increments
from pipeline.explicit import loading
from pipeline.reference import drive
from pipeline.store.fields import read_fields
from pipeline.study import (
    cross_check,
    diagnose_result,
    diagnose_together,
    dic,
    identify,
    model,
    observation,
    paths,
    request,
    simulate,
    truth,
    widening,
)

ROOT = Path(__file__).resolve().parents[1]
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", *DOCS]
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
USAGE = typer.BadParameter.__base__  # click's UsageError, wherever typer keeps it
TEXT = "\n".join(page.read_text("utf-8") for page in DOCS)


def blocks(page: Path, language: str) -> Iterator[str]:
    """The fenced blocks of a page in one language."""
    return (match[2] for match in FENCE.finditer(page.read_text("utf-8")) if match[1] == language)


def command_lines(page: Path) -> list[str]:
    """Every `cohesive-bpm` line of the shell blocks of a page."""
    lines = [line for block in blocks(page, "sh") for line in block.replace("\\\n", " ").splitlines()]
    return [line for line in lines if line.startswith("cohesive-bpm ")]


def parse(line: str) -> str | None:
    """The command of a line that is read as the program would, without running anything."""
    group = typer.main.get_command(app)
    _, *words = shlex.split(line, comments=True)
    with group.make_context("cohesive-bpm", list(words)) as context:
        name, command, rest = group.resolve_command(context, words)
        command.make_context(name, rest, parent=context).close()
    return name


def anchors(page: Path) -> set[str]:
    """What the headings of a page are called in links, as GitHub calls them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text("utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def dead(page: Path, link: str) -> str | None:
    """Why a relative link leads nowhere."""
    name, _, anchor = link.partition("#")
    target = (page.parent / name).resolve() if name else page
    if not target.exists():
        return f"{page.name}: {link}: no such file"
    if anchor and anchor not in anchors(target):
        return f"{page.name}: {link}: no such heading"
    return None


def dictionary_keys(function: Callable) -> set[str]:
    """The words that stand as keys in the dictionaries of a function."""
    tree = ast.parse(inspect.getsource(function))
    dicts = [node for node in ast.walk(tree) if isinstance(node, ast.Dict)]
    return {key.value for node in dicts for key in node.keys if isinstance(key, ast.Constant)}


def test_the_tables_are_up_to_date(tmp_path):
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    (tmp_path / "scripts").mkdir()
    script = shutil.copy(ROOT / "scripts" / "write_tables.py", tmp_path / "scripts")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    subprocess.run([sys.executable, script], env=environment, check=True, capture_output=True)
    for page in DOCS:
        written = (tmp_path / "docs" / page.name).read_text("utf-8")
        assert page.read_text("utf-8") == written, f"{page.name} is out of date: run python scripts/write_tables.py"


def test_every_table_of_the_code_is_shown():
    script = (ROOT / "scripts" / "write_tables.py").read_text("utf-8")
    names: dict = {"__name__": "tables", "__file__": str(ROOT / "scripts" / "write_tables.py")}
    exec(compile(script, "write_tables.py", "exec"), names)
    assert sorted(re.findall(r"<!-- table: (\w+) -->", TEXT)) == sorted(names["TABLES"])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_somewhere(page):
    text = COMMENT.sub("", FENCE.sub("", page.read_text("utf-8")))
    links = [link for link in LINK.findall(text) if not re.match(r"[a-z]+:", link)]
    assert not [reason for link in links if (reason := dead(page, link))]


@pytest.mark.parametrize("link", ["no-such-page.md", "theory.md#no-such-heading", "#no-such-heading"])
def test_a_dead_link_is_seen(link):
    assert dead(ROOT / "docs" / "README.md", link)


@pytest.mark.parametrize("line", sorted({line for page in PAGES for line in command_lines(page)}))
def test_command_lines_parse(line):
    assert parse(line) == shlex.split(line)[1]


@pytest.mark.parametrize(
    "line",
    [
        "cohesive-bpm identfy my-test -o out",
        "cohesive-bpm identify my-test",
        "cohesive-bpm identify my-test -o out --grid 1,2",
        "cohesive-bpm simulate my-test -o out --f-max 71 --delta-max 1e-4 --speed 3",
    ],
)
def test_a_wrong_command_line_is_seen(line):
    with pytest.raises(USAGE):
        parse(line)


def test_every_command_is_shown():
    shown = {shlex.split(line)[1] for line in command_lines(ROOT / "docs" / "README.md")}
    assert shown == set(typer.main.get_command(app).commands)


def test_the_lines_that_write_a_field_file_do_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    [code] = blocks(ROOT / "docs" / "bundle.md", "python")
    exec(compile(code, "bundle.md", "exec"), {})
    field = read_fields(tmp_path / "fields.h5")
    assert field.valid.all()
    assert np.ptp(field.points[:, 0]) == pytest.approx(24e-3, rel=1e-12)  # written in mm, read in m: one product
    assert field.std == pytest.approx(4e-7, rel=1e-12)  # likewise


@pytest.mark.parametrize(
    "function",
    [
        identify.identification_result,
        identify.estimate_result,
        identify.optimum_result,
        widening.widened_result,
        simulate.simulate,
        simulate.test_result,
        model.model,
        truth.truth_text,
        dic.dic_result,
        cross_check._result,
        cross_check._run_result,
        diagnose_result.diagnosis_result,
        diagnose_result.closure_result,
        diagnose_result.share_result,
        diagnose_result.card_result,
        diagnose_result.scatter_result,
        diagnose_together.together_result,
        diagnose_together.transfer_result,
        diagnose_together._one,
        diagnose_result.parameters,
    ],
)
def test_every_key_of_a_result_is_explained(function):
    named = set(re.findall(r"`(\w+)`", (ROOT / "docs" / "bundle.md").read_text("utf-8")))
    assert dictionary_keys(function) <= named


@pytest.mark.parametrize(
    ("page", "phrase"),
    [
        ("theory", f"within {loading.PERIODS} periods of the lowest mode"),
        ("theory", f"never below 1/{1 / loading.SLOWEST:.0f} of the highest"),
        ("theory", f"given up after {loading.LONGEST} periods"),
        ("theory", f"bracket so far exceeds ε/{1 / loading.LAG:.4g}"),
        ("theory", f"\\text{{error}} = {drive.ERROR_PER_EXCESS:.4g} "),
        ("engines", f"same strengths but for {paths.NEARLY:.1%}".replace("%", " %")),
        ("engines", f"between two records (default {loading.RECORD})"),
        (
            "theory",
            f"by 1/{1 / Increments().far:.0f} of the last CMOD, by 1/{1 / Increments().near:.0f} up to the peak",
        ),
        ("theory", f"while the load exceeds {Increments().near_load} of it"),
        ("theory", f"pitch is {request.PITCH} particle radii"),
        ("theory", f"within ±{truth.SPREAD:.0%} of the start".replace("%", " %")),
        ("theory", f"the paper's {request.CAMERA_MM_PER_PX} mm per pixel"),
        ("theory", "less than a tenth of their δ_max" if observation.PARTED == 0.1 else "changed"),
    ],
)
def test_numbers_are_those_of_the_code(page, phrase):
    text = " ".join((ROOT / "docs" / f"{page}.md").read_text("utf-8").split())
    assert phrase in text
