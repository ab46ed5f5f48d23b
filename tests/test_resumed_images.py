"""Images whose measuring was stopped and taken up again: the same fields, and no frame lost."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
from helpers.bundles import edit
from helpers.commands import end_group, run, start, wait_for

from pipeline.core.field import DisplacementField
from pipeline.execution.progress import Silent
from pipeline.store.fields import read_fields
from pipeline.study import dic as study


@pytest.fixture(scope="module")
def short(film: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first twelve images of the film, for what must be measured several times."""
    bundle = shutil.copytree(film, tmp_path_factory.mktemp("short") / "film")
    for image in sorted((bundle / "images").iterdir())[12:]:
        image.unlink()
    rows = (bundle / "frames.csv").read_text("utf-8").splitlines()
    (bundle / "frames.csv").write_text("\n".join(rows[:13]) + "\n", "utf-8")
    edit(bundle, sync_offset_s="0.25")
    return bundle


@pytest.fixture(scope="module")
def undisturbed(short: Path, tmp_path_factory: pytest.TempPathFactory) -> DisplacementField:
    """The fields of these when nothing stopped the command."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    done = run("dic", short, "-o", out, "--workers", "1")
    assert done.exit_code == 0, done.stderr
    return read_fields(out / "fields.h5")


class Interrupt(Silent):
    """Stops after so many images, as Ctrl-C does."""

    def __init__(self, after: int) -> None:
        self.left = after

    def done(self, key: str) -> None:
        """Count down."""
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def test_a_stopped_run_goes_on_where_it_stopped(short, undisturbed, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        study.dic(short, out, workers=1, progress=Interrupt(7))
    assert len(list((out / "frames").glob("*.h5"))) == 7
    (out / "frames" / "00007.h5").write_bytes(b"cut short")  # as by a full disk: it is correlated again
    done = run("dic", short, "-o", out, "--workers", "1")
    assert done.exit_code == 0, done.stderr
    assert "6 of 11 images are kept" in done.stderr
    again = read_fields(out / "fields.h5")
    np.testing.assert_array_equal(again.valid, undisturbed.valid)
    np.testing.assert_array_equal(
        again.displacement, undisturbed.displacement
    )  # to the last bit: as kept, so gone on from


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_stopped_process_leaves_whole_frames(short, undisturbed, tmp_path, how, code):
    out = tmp_path / "out"
    process = start("dic", short, "-o", out, "--workers", "1", scratch=tmp_path / "scratch")
    try:
        wait_for(lambda: len(list(out.glob("frames/0*.h5"))) >= 3)
        process.send_signal(how)
        told = process.communicate(timeout=60)[1]
    finally:
        end_group(process)
    assert process.returncode == code
    assert how == signal.SIGKILL or "give the same command again" in told
    kept = {path: path.stat().st_mtime_ns for path in out.glob("frames/0*.h5")}
    assert not (out / "result.json").exists()
    done = run("dic", short, "-o", out, "--workers", "1")
    assert done.exit_code == 0, done.stderr
    assert f"{len(kept)} of 11 images are kept" in done.stderr
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    again = read_fields(out / "fields.h5")
    np.testing.assert_array_equal(again.displacement, undisturbed.displacement)  # to the last bit
