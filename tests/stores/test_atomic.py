"""Whole or not at all; and what killed writers leave is swept where nobody can still be writing it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rahas.stores.atomic import TEMPORARY_PREFIX, replacing, sweep_dead

WRITER = """
import sys, time
from pathlib import Path
from rahas.stores.atomic import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(600)
"""


def left_overs(folder: Path) -> list[Path]:
    return list(folder.glob(f"{TEMPORARY_PREFIX}*"))


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process in the middle of writing a file."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path / "a.json")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_what_lives_is_left_and_what_is_dead_is_swept(tmp_path: Path, writer: subprocess.Popen[str]) -> None:
    with replacing(tmp_path / "b.json") as temporary:
        temporary.write_text("mine")
        sweep_dead(tmp_path)
        assert len(left_overs(tmp_path)) == 2
    assert (tmp_path / "b.json").read_text() == "mine"
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    sweep_dead(tmp_path)
    assert left_overs(tmp_path) == []
    assert [path.name for path in tmp_path.iterdir()] == ["b.json"]


def test_another_machines_are_left_for_two_days(tmp_path: Path) -> None:
    folders = [tmp_path / f"{TEMPORARY_PREFIX}{name}" for name in ("node.17-999999999-abc", "former_kind")]
    for folder in folders:
        folder.mkdir()
        (folder / "a.json").write_text("half")
    sweep_dead(tmp_path)
    assert sorted(left_overs(tmp_path)) == sorted(folders)
    for folder in folders:
        os.utime(folder, (time.time() - 3 * 24 * 3600,) * 2)
    sweep_dead(tmp_path)
    assert left_overs(tmp_path) == []


def test_no_folder(tmp_path: Path) -> None:
    sweep_dead(tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == []
