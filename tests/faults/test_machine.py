"""A failing machine: a full disk, no permission. Clear errors, no partial files, and the same command goes on."""

from __future__ import annotations

import resource
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.workflow.expedition import NOTHING, ROWS, Expedition, assert_nothing_half_written, assert_whole, row


def assert_goes_on(finished: Expedition) -> None:
    """With the machine in order, the same command ends well."""
    run = finished.run()
    assert run.status == 0, run.output
    assert finished.verdict("take2") == "accepted"
    assert_whole(finished.root / "results")
    assert NOTHING in finished.run().output


@pytest.fixture
def second_take(finished: Expedition) -> Expedition:
    finished.log([*ROWS, row("take2", capture="rock.mkv", texture="rock_texture.png")])
    return finished


def test_file_size_limit(second_take: Expedition) -> None:
    """No file may grow past 300 kB: the first chunk of the frames fails as on a full disk."""
    run = second_take.run(preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000)))
    assert run.status != 0
    assert "rahas: " in run.output
    assert "run the same command again" in run.output
    assert not (second_take.scan("take2") / "frames.zarr").exists()
    assert_nothing_half_written(second_take.root / "results")
    assert second_take.verdict("rock") == "accepted"
    assert_goes_on(second_take)


@pytest.fixture
def small_disk(second_take: Expedition, tmp_path: Path) -> Iterator[Expedition]:
    """results/ on a file system of its own, with room for what is there and a little more."""
    results = second_take.root / "results"
    used = sum(path.stat().st_size for path in results.rglob("*") if path.is_file())
    shutil.move(results, tmp_path / "results")
    results.mkdir()
    size = used + 6_000_000
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(results)], check=False, capture_output=True
    )
    if mounted.returncode:
        pytest.skip("a small file system cannot be mounted here (not root)")
    try:
        shutil.copytree(tmp_path / "results", results, dirs_exist_ok=True)
        yield second_take
    finally:
        subprocess.run(["umount", "-l", str(results)], check=True)


@pytest.mark.faults
def test_full_disk(small_disk: Expedition) -> None:
    results = small_disk.root / "results"
    run = small_disk.run()
    assert run.status != 0
    assert "No space left on device" in run.output
    assert_nothing_half_written(results)
    subprocess.run(["mount", "-o", "remount,size=200000000", str(results)], check=True)
    assert_goes_on(small_disk)


def test_results_in_the_way(second_take: Expedition) -> None:
    """A file where the scan's folder belongs: told before anything runs."""
    second_take.scan("take2").write_text("in the way")
    run = second_take.run()
    assert (run.status, run.started) == (1, set())
    assert "results/take2: found a file of that name, expected a folder" in run.output
    assert "Traceback (most recent" not in run.output


@pytest.mark.faults
def test_no_permission(small_disk: Expedition) -> None:
    """results/ may not be written, be it for root."""
    results = str(small_disk.root / "results")
    subprocess.run(["mount", "-o", "remount,ro", results], check=True)
    run = small_disk.run()
    assert (run.status, run.started) == (1, set())
    assert "results: found no permission to write there" in run.output
    assert "Traceback (most recent" not in run.output
    subprocess.run(["mount", "-o", "remount,rw,size=200000000", results], check=True)
    assert_goes_on(small_disk)


@pytest.mark.faults
def test_captures_are_only_read(second_take: Expedition) -> None:
    """The whole chain on captures that may not be written: nothing changes, nothing is added."""
    captures = second_take.root / "captures"
    for path in captures.iterdir():
        path.chmod(0o444)
    captures.chmod(0o555)
    before = {p.name: (p.stat().st_mtime_ns, p.stat().st_ctime_ns) for p in [captures, *captures.iterdir()]}
    digests = second_take.digests("captures")
    try:
        assert_goes_on(second_take)
        assert second_take.digests("captures") == digests
        assert {p.name: (p.stat().st_mtime_ns, p.stat().st_ctime_ns) for p in [captures, *captures.iterdir()]} == before
    finally:
        captures.chmod(0o755)
