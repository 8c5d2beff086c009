"""What was damaged since it was made is not read: it is made again, or said; a stale file asked for is made anew."""

from __future__ import annotations

from tests.workflow.expedition import Expedition

FINER = "cloud: {normal_radius_px: 3}\n"


def test_damaged_store_is_made_again_before_it_is_read(finished: Expedition) -> None:
    finished.configure(FINER)
    assert finished.run().status == 0
    sound = finished.digests()["rock/cloud.ply"]
    chunk = next((finished.scan("rock") / "phase.zarr" / "unwrapped_phase").rglob("c/*/*"))
    chunk.write_bytes(next((finished.scan("rock") / "phase.zarr" / "wrapped_phase").rglob("c/*/*")).read_bytes())
    finished.configure("cloud: {normal_radius_px: 4}\n")
    run = finished.run()
    assert run.status == 0, run.output
    assert "is not what was written" in run.output
    assert ("rock", "phase") in run.made
    finished.configure(FINER)
    assert finished.run().status == 0
    assert finished.digests()["rock/cloud.ply"] == sound


def test_damaged_calibration_is_said_and_hurts_no_other_scan(finished: Expedition) -> None:
    finished.configure(FINER)
    assert finished.run().status == 0
    sound = finished.digests()["rock/cloud.ply"]
    calibration = finished.scan("cal") / "calibration.json"
    calibration.write_text(calibration.read_text(encoding="utf-8").replace("1", "2", 1), encoding="utf-8")
    finished.configure("cloud: {normal_radius_px: 4}\n")
    run = finished.run()
    assert run.status != 0
    assert "results/cal/calibration.json: is not what was written" in run.output
    assert finished.verdict("far") == "rejected: object_span"
    calibration.unlink()
    assert finished.run().status == 0
    finished.configure(FINER)
    assert finished.run().status == 0
    assert finished.digests()["rock/cloud.ply"] == sound


def test_stale_file_asked_for_by_name_is_made_anew(finished: Expedition) -> None:
    before = finished.digests()["rock/cloud.ply"]
    finished.configure("cloud: {normal_radius_px: 5}\n")
    run = finished.run("results/rock/cloud.ply")
    assert run.status == 0, run.output
    assert run.made == [("rock", "cloud"), ("rock", "review_result")]
    assert finished.digests()["rock/cloud.ply"] != before
