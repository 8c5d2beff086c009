"""Runs are kept once, whole, the same everywhere, and can be read again."""

from __future__ import annotations

import gzip
import json
import os
from pathlib import Path

import pytest

from rahas.provenance.history import keep_run, read_run, runs
from rahas.provenance.records import read_record
from rahas.stores.layout import ScanFolder
from tests.provenance.records_builder import write_row

ROWS = ("rock1", "rock2")


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "one" / "results"
    for scan_id in ROWS:
        write_row(folder, scan_id, metrics={"jitter": 0.123456789012345, "points": 1000}, method="joint")
    return folder


def names(results: Path) -> list[str]:
    return sorted(path.name for path in (results / "history").iterdir())


def test_a_run_is_kept_once(results: Path) -> None:
    assert keep_run(results, ROWS) == results / "history" / "0001.json.gz"
    assert keep_run(results, ROWS) is None
    assert names(results) == ["0001.json.gz", "0001.made.json"]


@pytest.mark.parametrize(
    "change", [{"method": "thesis"}, {"verdict": "rejected"}, {"metrics": {"jitter": 0.123456789012346}}]
)
def test_a_change_keeps_one_run_more_and_the_former_as_it_was(results: Path, change: dict[str, object]) -> None:
    former = keep_run(results, ROWS)
    assert former is not None
    before = former.read_bytes()
    write_row(
        results, "rock2", **{"metrics": {"jitter": 0.123456789012345, "points": 1000}, "method": "joint"} | change
    )
    assert keep_run(results, ROWS) == results / "history" / "0002.json.gz"
    assert keep_run(results, ROWS) is None
    assert [run.number for run in runs(results)] == [1, 2]
    assert former.read_bytes() == before


def test_numbers_go_on_after_the_newest(results: Path) -> None:
    keep_run(results, ROWS)
    (results / "history" / "0001.json.gz").rename(results / "history" / "9999.json.gz")
    (results / "history" / "note.txt").write_text("by hand")
    write_row(results, "rock2", verdict="rejected")
    assert keep_run(results, ROWS) == results / "history" / "10000.json.gz"


def test_the_records_come_back_as_they_were(results: Path) -> None:
    kept = keep_run(results, ROWS)
    assert kept is not None
    states = read_run(kept)
    assert set(states) == set(ROWS)
    for scan_id, state in states.items():
        scan = ScanFolder(results, scan_id)
        assert state.qa == json.loads(scan.qa.read_text(encoding="utf-8"))
        assert set(state.records) == {"timeline", "phase", "cloud"}
        for stage, record in state.records.items():
            there = read_record(scan.records / f"{stage}.json")
            assert there is not None
            assert (record, record.recipe.key) == (there, there.recipe.key)
        assert set(state.artifacts) == {"timeline.json", "phase.json", "cloud.json"}


def test_the_same_work_elsewhere_and_later_gives_the_same_bytes(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = keep_run(results, ROWS)
    elsewhere = tmp_path / "another place" / "results"
    for scan_id in reversed(ROWS):
        write_row(elsewhere, scan_id, metrics={"points": 1000, "jitter": 0.123456789012345}, method="joint")
    monkeypatch.setattr("time.time", lambda: 2_000_000_000.0)
    again = keep_run(elsewhere, tuple(reversed(ROWS)))
    assert kept is not None
    assert again is not None
    assert kept.read_bytes() == again.read_bytes()
    assert str(tmp_path).encode() not in gzip.decompress(kept.read_bytes())


def test_when_and_where_stand_beside_it(results: Path) -> None:
    keep_run(results, ROWS)
    made = runs(results)[0].made
    assert set(made) == {"time", "host", "commit", "tree_clean"}
    assert made["host"].encode() not in gzip.decompress(runs(results)[0].path.read_bytes())


def test_a_row_that_is_not_finished_has_no_verdict(results: Path) -> None:
    kept = keep_run(results, [*ROWS, "rock3"], unfinished={"rock2"})
    assert kept is not None
    states = read_run(kept)
    assert [states[name].qa is None for name in (*ROWS, "rock3")] == [False, True, True]
    assert states["rock2"].records.keys() == states["rock1"].records.keys()


def test_killed_half_way_leaves_no_partial_run(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The process dies when the run is written and not yet renamed; the next one goes on as if nothing were."""
    child = os.fork()
    if child == 0:
        replace = os.replace

        def die(source: str, target: str) -> None:
            if str(target).endswith(".gz"):
                os._exit(9)
            replace(source, target)

        monkeypatch.setattr(os, "replace", die)
        keep_run(results, ROWS)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert not list((results / "history").glob("*.gz"))
    assert list((results / "history").glob(".making-*/0001.json.gz"))
    assert runs(results) == []
    kept = keep_run(results, ROWS)
    assert kept is not None
    assert set(read_run(kept)) == set(ROWS)
    assert names(results) == ["0001.json.gz", "0001.made.json"]


def test_a_full_disk_leaves_no_partial_run(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(text: bytes, **_: object) -> bytes:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(gzip, "compress", full)
        with pytest.raises(OSError, match="No space left"):
            keep_run(results, ROWS)
    assert runs(results) == []
    assert keep_run(results, ROWS) == results / "history" / "0001.json.gz"


def test_records_of_another_schema_keep_their_digests(results: Path) -> None:
    path = ScanFolder(results, "rock1").records / "phase.json"
    raw = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**raw, "schema": 0, "what": "was once here"}), encoding="utf-8")
    kept = keep_run(results, ROWS)
    assert kept is not None
    state = read_run(kept)["rock1"]
    assert set(state.records) == {"timeline", "cloud"}
    assert state.artifacts["phase.json"] == raw["outputs"]["phase.json"]


@pytest.mark.parametrize("damage", [lambda b: b[:-9], lambda b: b[:200] + b"\0\0\0" + b[203:], lambda b: b"none"])
def test_a_damaged_run_is_said_to_be(results: Path, damage: object) -> None:
    kept = keep_run(results, ROWS)
    assert kept is not None
    kept.write_bytes(damage(kept.read_bytes()))  # type: ignore[operator]
    with pytest.raises(ValueError, match="0001"):
        read_run(kept)


def test_its_size_grows_by_little_for_each_row(tmp_path: Path) -> None:
    """What rows share stands there once: a row costs its own digests and numbers."""
    sizes = []
    for count in (20, 40):
        folder = tmp_path / str(count) / "results"
        rows = [f"rock{n}" for n in range(count)]
        for scan_id in rows:
            write_row(folder, scan_id, metrics={"points": len(scan_id)}, method="joint")
        kept = keep_run(folder, rows)
        assert kept is not None
        sizes.append(kept.stat().st_size)
    assert 10 < (sizes[1] - sizes[0]) / 20 < 400
