"""Commands that are refused: one message in words of ours, and nothing lost."""

from __future__ import annotations

from pathlib import Path

from helpers.commands import run

FAULT = "fault of the program"
PARAMETERS = ("--f-max", "355", "--delta-max", "1.14e-4")


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_one_message(told: str, *expected: str) -> None:
    """One message ends what was told, in words of ours."""
    assert told.count("cohesive-bpm: ") == 1
    message = told[told.index("cohesive-bpm: ") :]
    for text in expected:
        assert text in message
    assert FAULT not in told
    assert "Traceback" not in told
    assert "Warning" not in told


def assert_refused(folder: Path, line: tuple[object, ...], *expected: str) -> None:
    """The command ends with one message and exit code 1; every file below `folder` is as before."""
    before = contents(folder)
    ended = run(*line)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(ended.stderr, *expected)
    assert before.items() <= contents(folder).items()
    assert not list(folder.rglob("*.part"))


def lines(command: str, bundle: Path) -> tuple[object, ...]:
    """A command on a bundle, with results beside it."""
    more = {"check": (), "model": (), "simulate": PARAMETERS, "identify": ("--grid", "0.9,1,1.1")}[command]
    place = () if command == "check" else ("-o", bundle.parent / "out")
    return (command, bundle, *place, *more)
