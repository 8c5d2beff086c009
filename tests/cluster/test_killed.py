"""A job, its node or the scheduler dies half-way: the same command goes on from there, to the same bytes."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable

import pytest

from tests.cluster.runs import ClusterExpedition, wait_patiently
from tests.cluster.slurm import Slurm
from tests.faults.test_killed import add_second_take, assert_like_rock, is_writing
from tests.workflow.expedition import NOTHING, assert_nothing_half_written, jobs_running

pytestmark = [pytest.mark.cluster, pytest.mark.timeout(1800)]


def cancel(slurm: Slurm) -> None:
    for job in slurm.jobs():
        slurm.run("scancel", job)


def kill_step(slurm: Slurm) -> None:
    for pid in slurm.processes():
        with contextlib.suppress(ProcessLookupError):  # it ended with another
            os.kill(pid, signal.SIGKILL)


def lose_node(slurm: Slurm) -> None:
    slurm.kill_node()
    slurm.start_node()
    slurm.run("scontrol", "reconfigure")  # the controller asks what runs there; by itself it does so after some minutes


@pytest.mark.parametrize("accident", [cancel, kill_step, lose_node])
def test_resumed(processed: ClusterExpedition, accident: Callable[[Slurm], None]) -> None:
    """Cut off while it writes its phase; what was whole by then is not made again."""
    add_second_take(processed)
    process = processed.start()
    wait_patiently(is_writing(processed, "take2", "phase.zarr"), process)
    accident(processed.cluster)
    said, _ = process.communicate(timeout=600)
    assert process.returncode != 0, said
    before = processed.made_so_far()
    assert ("take2", "snakes") in before
    assert ("take2", "phase") not in before
    assert_nothing_half_written(processed.root / "results")
    again = processed.run()
    assert again.status == 0, again.output
    assert {scan for scan, _ in again.made} == {"take2"}
    assert not set(again.made) & set(before), "made twice"
    assert_like_rock(processed)
    assert NOTHING in processed.run().output


def test_tried_again_by_itself(processed: ClusterExpedition) -> None:
    """With the profile's `retries: 1` a job that was killed once needs nobody."""
    add_second_take(processed)
    process = processed.start("--retries", "1")
    wait_patiently(is_writing(processed, "take2", "phase.zarr"), process)
    cancel(processed.cluster)
    said, _ = process.communicate(timeout=600)
    assert process.returncode == 0, said
    assert_like_rock(processed)


def test_more_memory_at_the_second_attempt(processed: ClusterExpedition) -> None:
    """Slurm kills what takes more than it asked for; the next attempt asks for enough."""
    add_second_take(processed)
    sizes = [f"{job}:mem_mb=200 if attempt == 1 else 3000" for job in ("capture", "phase", "surface")]
    before = processed.cluster.submitted()
    run = processed.run("--retries", "1", "--set-resources", *sizes)
    assert run.status == 0, run.output
    assert processed.cluster.submitted() - before == 2
    assert_like_rock(processed)


def test_scheduler_killed(processed: ClusterExpedition) -> None:
    """Its job goes on, on the node; the next scheduler's job of that scan waits for it and computes nothing twice."""
    add_second_take(processed)
    process = processed.start()
    wait_patiently(is_writing(processed, "take2", "frames.zarr"), process)
    orphans = list(jobs_running(processed.root))
    for pid in orphans:
        os.kill(pid, signal.SIGSTOP)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    logs = processed.root / ".snakemake" / "slurm_logs"
    again = processed.start()
    try:
        wait_patiently(lambda: "waiting for an earlier job of this scan to end" in processed.job_logs(), again)
    finally:
        for pid in orphans:
            os.kill(pid, signal.SIGCONT)
    said, _ = again.communicate(timeout=600)
    assert again.returncode == 0, said
    assert logs.is_dir()
    assert processed.job_logs().count("rahas: take2: ingest made in") <= 1
    assert_like_rock(processed)
    assert NOTHING in processed.run().output
