"""kill -9, at any moment, of a job or of the scheduler: nothing half-written, and the same command ends well."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable

import pytest

from tests.workflow.expedition import (
    MADE,
    NOTHING,
    ROWS,
    Expedition,
    assert_nothing_half_written,
    assert_whole,
    jobs_running,
    row,
    wait_for,
)

PATIENCE_S = 120.0


def is_writing(expedition: Expedition, scan_id: str, name: str) -> Callable[[], bool]:
    """Whether the artifact lies there under a temporary name."""
    return lambda: bool(list(expedition.scan(scan_id).glob(f".making-*/{name}")))


def add_second_take(finished: Expedition) -> None:
    """One row more to process, of the same capture as ``rock``: its numbers must be the same in the end."""
    finished.log([*ROWS, row("take2", capture="rock.mkv", texture="rock_texture.png")])


def assert_like_rock(finished: Expedition) -> None:
    assert finished.verdict("take2") == "accepted"
    for name in ("frames.zarr", "snakes.zarr"):
        manifests = [(finished.scan(s) / name / "manifest.json").read_bytes() for s in ("rock", "take2")]
        assert manifests[0] == manifests[1], name
    bodies = [(finished.scan(s) / "cloud.ply").read_bytes().partition(b"end_header\n")[2] for s in ("rock", "take2")]
    assert bodies[0] == bodies[1]
    assert_whole(finished.root / "results")


@pytest.mark.parametrize(
    ("job", "artifact", "done"),
    [
        ("capture take2", "frames.zarr", set()),
        pytest.param(
            "phase take2", "phase.zarr", {"ingest", "timeline", "review_capture", "snakes"}, marks=pytest.mark.faults
        ),
    ],
)
def test_killed_job_hurts_its_own_scan_only(finished: Expedition, job: str, artifact: str, done: set[str]) -> None:
    finished.log([*ROWS, row("take2", capture="rock.mkv", texture="rock_texture.png"), row("far2", capture="far.mkv")])
    process = finished.start()
    wait_for(is_writing(finished, "take2", artifact), process)
    killed = [pid for pid, what in jobs_running(finished.root).items() if what == job]
    for pid in killed:
        os.kill(pid, signal.SIGKILL)
    output, _ = process.communicate(timeout=PATIENCE_S)
    assert len(killed) == 1
    assert process.returncode != 0, output
    assert finished.verdict("far2") == "rejected: object_span"
    assert not (finished.scan("take2") / artifact).exists()
    assert_nothing_half_written(finished.root / "results")
    assert "take2" in finished.table()
    assert finished.table()["take2"]["verdict"] != "accepted"
    assert any(line.split()[:1] == ["take2"] and "same command" in line for line in output.splitlines()), output

    again = finished.run()
    assert again.status == 0, again.output
    assert again.started == {"take2"}
    assert {stage for _, stage in again.made} & done == set()
    assert_like_rock(finished)
    assert NOTHING in finished.run().output


@pytest.mark.faults
def test_killed_while_an_artifact_is_made_again(finished: Expedition) -> None:
    """The stamp of the first time must not speak for the second."""
    (finished.scan("rock") / "cloud.ply").unlink()
    process = finished.start()
    wait_for(is_writing(finished, "rock", "cloud.*"), process)
    for pid in jobs_running(finished.root):
        os.kill(pid, signal.SIGKILL)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode != 0
    again = finished.run()
    assert again.status == 0, again.output
    assert again.made == [("rock", "cloud")]
    assert_whole(finished.root / "results")


def test_killed_scheduler(finished: Expedition) -> None:
    """Its job outlives it; the same command is not locked out, waits for that job and goes on from there."""
    add_second_take(finished)
    process = finished.start()
    wait_for(is_writing(finished, "take2", "frames.zarr"), process)
    orphans = list(jobs_running(finished.root))
    for pid in orphans:
        os.kill(pid, signal.SIGSTOP)
    os.kill(process.pid, signal.SIGKILL)
    again = finished.start()
    heard = ""
    try:
        assert again.stdout is not None
        for line in again.stdout:
            heard += line
            if "waiting for an earlier job" in line:
                break
    finally:
        for pid in orphans:
            os.kill(pid, signal.SIGCONT)
    heard += again.communicate(timeout=PATIENCE_S)[0]
    assert again.returncode == 0, heard
    assert "take2: waiting for an earlier job of this scan to end" in heard
    heard += process.communicate(timeout=PATIENCE_S)[0]
    assert sum(found == ("take2", "ingest") for found in MADE.findall(heard)) == 1, heard
    assert_like_rock(finished)
    assert NOTHING in finished.run().output


@pytest.mark.faults
def test_killed_scheduler_and_jobs(finished: Expedition) -> None:
    add_second_take(finished)
    process = finished.start()
    wait_for(is_writing(finished, "take2", "frames.zarr"), process)
    os.killpg(process.pid, signal.SIGKILL)
    for pid in jobs_running(finished.root):
        os.kill(pid, signal.SIGKILL)
    process.communicate(timeout=PATIENCE_S)
    assert_nothing_half_written(finished.root / "results")
    again = finished.run()
    assert again.status == 0, again.output
    assert ("take2", "ingest") in again.made
    assert_like_rock(finished)
    assert NOTHING in finished.run().output


@pytest.mark.faults
def test_two_schedulers_at_once(finished: Expedition) -> None:
    add_second_take(finished)
    both = [finished.start(), finished.start()]
    outputs = [process.communicate(timeout=2 * PATIENCE_S)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0], outputs
    computed = sorted(MADE.findall("".join(outputs)))
    assert len(computed) == len(set(computed)), "nothing was computed twice"
    assert_like_rock(finished)
    assert NOTHING in finished.run().output


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(3))
def test_killed_at_any_moment(finished: Expedition, seed: int) -> None:
    """Scheduler and jobs together, again and again, at moments that nobody chose; each time it goes on from there."""
    import random

    add_second_take(finished)
    moments = random.Random(seed)
    for _ in range(4):
        process = finished.start()
        try:
            process.communicate(timeout=moments.uniform(3, 9))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        for pid in jobs_running(finished.root):
            os.kill(pid, signal.SIGKILL)
        assert_nothing_half_written(finished.root / "results")
    assert finished.run().status == 0
    assert_like_rock(finished)
