"""From captures to pages by the one command; then nothing to do, whatever happened to the files' times and place."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import pytest

from tests.workflow.expedition import NOTHING, Expedition, Run, assert_whole, copy_code
from tests.workflow.reruns import assert_runs

EVERY = ["frames.zarr", "timeline.json", "qa.json", "report.html"]
OF_ACCEPTED = [*EVERY, "snakes.zarr", "phase.zarr", "cloud.zarr", "cloud.ply"]
OF_CALIBRATION = [*EVERY, "snakes.zarr", "phase.zarr", "calibration.json"]
BEYOND_REJECTION = ["snakes.zarr", "phase.zarr", "cloud.zarr", "cloud.ply", "calibration.json"]


def test_first_run(first_run: tuple[Expedition, Run]) -> None:
    expedition, run = first_run
    assert run.status == 0, run.output
    assert {name: expedition.verdict(name) for name in ("cal", "rock", "far")} == {
        "cal": "accepted",
        "rock": "accepted",
        "far": "rejected: object_span",
    }
    assert all((expedition.scan("rock") / name).exists() for name in OF_ACCEPTED)
    assert all((expedition.scan("cal") / name).exists() for name in OF_CALIBRATION)
    assert all((expedition.scan("far") / name).exists() for name in EVERY)
    assert not [name for name in BEYOND_REJECTION if (expedition.scan("far") / name).exists()]
    assert (expedition.root / "results" / "index.html").stat().st_size > 1000
    table = expedition.table()
    assert list(table) == ["cal", "rock", "far"]
    assert table["far"]["verdict"] == "rejected"
    assert table["far"]["rule"] == "object_span"
    assert 0.1 < float(table["far"]["object_span"]) < 0.4
    assert_whole(expedition.root / "results")


def test_closing_lines(first_run: tuple[Expedition, Run]) -> None:
    lines = first_run[1].output.splitlines()
    start = lines.index("3 captures: 2 accepted, 1 rejected, 0 not processed")
    assert lines[start + 1].split()[:3] == ["far", "rejected", "object_span:"]
    assert len(lines[start + 1]) > 80, "a sentence says why"
    assert "results/index.html" in lines[start + 2]


def test_nothing_is_written_beside_results(first_run: tuple[Expedition, Run], rendered: Expedition) -> None:
    expedition, _ = first_run
    assert expedition.digests("captures") == rendered.digests("captures")
    assert sorted(p.name for p in expedition.root.iterdir()) == sorted(
        [".snakemake", "captures", "config", "field_log.csv", "results"]
    )


def test_second_run_runs_nothing(finished: Expedition) -> None:
    before = finished.digests()
    assert_runs("nothing", finished.run())
    assert finished.digests() == before


def test_lost_metadata_computes_nothing(finished: Expedition) -> None:
    shutil.rmtree(finished.root / ".snakemake")
    assert_runs("lost .snakemake", finished.run())


def test_touched_files_compute_nothing(finished: Expedition) -> None:
    before = finished.digests()
    now = time.time()
    for n, path in enumerate(sorted(finished.root.rglob("*"))):
        if ".snakemake" not in path.parts:
            os.utime(path, (now + n % 7, now + n % 7))
    assert_runs("touched", finished.run())
    assert {n: d for n, d in finished.digests().items() if ".zarr" in n or n.endswith(("ply", "html"))} == {
        n: d for n, d in before.items() if ".zarr" in n or n.endswith(("ply", "html"))
    }
    assert NOTHING in finished.run().output


def test_fresh_clone_computes_nothing(finished: Expedition, tmp_path: Path) -> None:
    """Captures, results and code copied to another place, without times and without Snakemake's own folder."""
    no_snakemake = shutil.ignore_patterns(".snakemake")
    shutil.copytree(finished.root, tmp_path / "elsewhere", copy_function=shutil.copyfile, ignore=no_snakemake)
    clone = Expedition(tmp_path / "elsewhere", copy_code(tmp_path / "code", finished.code))
    assert_runs("copied", clone.run())


def test_deleted_artifacts_are_made_again(finished: Expedition) -> None:
    before = finished.digests()
    (finished.scan("rock") / "cloud.ply").unlink()
    shutil.rmtree(finished.scan("rock") / "phase.zarr")
    (finished.root / "results" / "index.html").unlink()
    shutil.rmtree(finished.scan("far") / "figures")
    assert_runs("deleted artifacts", finished.run())
    after = finished.digests()
    assert {n for n in before if before[n] != after.get(n) and "/provenance/" not in n} == set()
    assert NOTHING in finished.run().output


def test_deleted_index_alone_is_made_again(finished: Expedition) -> None:
    before = finished.digests()
    (finished.root / "results" / "scans.csv").unlink()
    run = finished.run()
    assert (run.status, run.made, run.pages) == (0, [], []), run.output
    assert finished.digests()["scans.csv"] == before["scans.csv"]


def test_file_by_name(finished: Expedition) -> None:
    (finished.scan("rock") / "cloud.ply").unlink()
    run = finished.run("results/rock/cloud.ply")
    assert run.status == 0, run.output
    assert run.made == [("rock", "cloud")]
    assert (finished.scan("rock") / "cloud.ply").exists()
    assert finished.run("results/rock/cloud.ply", "results/rock/phase.zarr").status == 0


def test_file_by_name_from_nothing(finished: Expedition) -> None:
    """Only what the file needs is made: its scan, as far as that, and its calibration."""
    shutil.rmtree(finished.root / "results")
    run = finished.run("results/rock/timeline.json")
    assert run.status == 0, run.output
    assert {scan for scan, _ in run.made} == {"rock"}
    assert {stage for _, stage in run.made} == {"ingest", "timeline", "review_capture"}


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("results/far/cloud.ply", "object_span"),
        ("results/cal/cloud.ply", "a calibration has no cloud.ply"),
        ("results/nobody/cloud.ply", "no row with scan_id 'nobody'"),
    ],
)
def test_file_that_cannot_be(finished: Expedition, name: str, told: str) -> None:
    run = finished.run(name)
    assert run.status != 0
    assert told in run.output
    assert "Traceback (most recent" not in run.output
    assert not (finished.root / name).exists()
    assert run.made == []
