"""`rahas diff`: nothing where nothing differs; known changes of an expedition as the figures that they are."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from rahas.cli import main
from rahas.provenance.history import keep_run
from rahas.stores.arrays import open_store, writing_store
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder
from tests.provenance.records_builder import write_records, write_row
from tests.report import expedition_builder as build

SCHEMA = Path(__file__).parents[2] / "docs" / "schemas" / "diff.schema.json"
SHAPE = (96, 128)
UNMEASURED = 20 * 30  # pixels of the builder's corner


def rewrite(path: Path, edit: Callable[[dict[str, np.ndarray]], None]) -> None:
    """Write a store anew with its arrays edited."""
    group = open_store(path)
    arrays = {name: array[...] for name, array in group.arrays()}
    dims = {name: array.metadata.dimension_names for name, array in group.arrays()}
    edit(arrays)
    with writing_store(path) as store:
        for name, values in arrays.items():
            store.put(name, dims[name], values)


@pytest.fixture
def before(tmp_path: Path) -> Path:
    root = tmp_path / "before"
    for scan_id in ("rock1", "rock2"):
        scan = ScanFolder(root / "results", scan_id)
        build.write_all(scan, shape=SHAPE)
        write_records(scan, {"method": "joint"}, phase=(scan.phase,), cloud=(scan.cloud, scan.cloud_ply))
    return root


@pytest.fixture
def after(before: Path, tmp_path: Path) -> Path:
    return shutil.copytree(before, tmp_path / "after")


def diff(*arguments: object) -> int:
    return main(["diff", *map(str, arguments)])


def told(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 1) -> dict[str, Any]:
    assert diff(*arguments, "--json") == status
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8"))).validate(found)
    return found


def row(found: dict[str, Any], scan_id: str = "rock1") -> dict[str, Any]:
    return next(scan for scan in found["scans"] if scan["scan_id"] == scan_id)


def test_identical_folders(before: Path, after: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    assert diff(before, after, "--page", page) == 0
    assert "Nothing differs." in capsys.readouterr().out
    assert "Nothing differs." in page.read_text(encoding="utf-8")
    found = told(capsys, before, after / "results", status=0)
    assert [scan["differs"] for scan in found["scans"]] == [False, False]


def test_a_cloud_moved(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By 0.1 mm, where the builder's σ is 0.05 mm on both sides."""

    def move(arrays: dict[str, np.ndarray]) -> None:
        arrays["xyz"][..., 2] += np.float32(0.1)

    rewrite(after / "results" / "rock1" / "cloud.zarr", move)
    found = told(capsys, before, after)
    scan, depth = row(found), row(found)["depth"]
    assert scan["artifacts"] == {"cloud.zarr": "changed"}
    assert [note.split(":")[0] for note in scan["notes"]] == ["no recipe changed"]
    assert depth["compared"] == SHAPE[0] * SHAPE[1] - UNMEASURED
    assert (depth["gained"], depth["lost"]) == (0, 0)
    for name in ("median_mm", "rms_mm", "p95_mm"):
        assert depth[name] == pytest.approx(0.1, abs=2e-6)
    for name in ("median_sigmas", "rms_sigmas", "p95_sigmas"):
        assert depth[name] == pytest.approx(0.1 / np.hypot(0.05, 0.05), abs=1e-4)
    assert scan["phase"] is None
    assert not row(found, "rock2")["differs"]


def test_points_removed(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def remove(arrays: dict[str, np.ndarray]) -> None:
        arrays["xyz"][90:, :50] = np.nan
        arrays["xyz"][:5, :30] = 1.0

    rewrite(after / "results" / "rock1" / "cloud.zarr", remove)
    depth = row(told(capsys, before, after))["depth"]
    assert (depth["gained"], depth["lost"], depth["rms_mm"]) == (5 * 30, 6 * 50, 0.0)
    assert depth["compared"] == SHAPE[0] * SHAPE[1] - UNMEASURED - 6 * 50


def test_orders_changed(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def shift(arrays: dict[str, np.ndarray]) -> None:
        arrays["unwrapped_phase"] += np.float32(0.02)
        arrays["unwrapped_phase"][50:60] += np.float32(2 * np.pi)

    rewrite(after / "results" / "rock1" / "phase.zarr", shift)
    assert diff(before, after) == 1
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("rock1 "))
    phase = row(told(capsys, before, after))["phase"]
    assert (phase["compared"], phase["orders_changed"]) == (SHAPE[0] * SHAPE[1] - UNMEASURED, 10 * 128)
    assert phase["rms_rad"] == pytest.approx(0.02, abs=1e-5)
    assert line.split()[-3:] == ["11", "%", "20"]  # 1280 of 11688 pixels, mrad


def test_verdict_metrics_and_reasons(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    qa = after / "results" / "rock1" / "qa.json"
    content = read_json(qa)
    reasons = [build.reason(message="It \x1b[31mshook.")]
    write_json(qa, {**content, "verdict": "rejected", "reasons": reasons, "metrics": {"jitter": 3.4, "periods": 1.62}})
    found = row(told(capsys, before, after))
    assert found["verdict"] == ["accepted", "rejected"]
    assert found["metrics"] == {"object_span": [0.93, None], "jitter": [0.21, 3.4]}
    assert found["reasons"] == [[], reasons]
    assert diff(before, after) == 1
    out = capsys.readouterr().out
    assert "accepted → rejected" in out
    assert "jitter: 0.21 px → 3.4 px  (+3.19)" in out
    assert "reason after: It [31mshook." in out
    assert all(c.isprintable() or c == "\n" for c in out)


def test_rows_and_artifacts_that_one_side_lacks(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(after / "results" / "rock2")
    shutil.rmtree(after / "results" / "rock1" / "cloud.zarr")
    write_row(after / "results", "rock3")
    found = told(capsys, before, after)
    assert [scan["only"] for scan in found["scans"]] == [None, "before", "after"]
    assert (row(found)["artifacts"], row(found)["depth"]) == ({"cloud.zarr": "gone"}, None)


def test_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was changed by hand is told, what follows from it is not."""
    for side, method in (("before", "thesis"), ("after", "joint")):
        for scan_id in ("rock1", "rock2"):
            write_row(tmp_path / side / "results", scan_id, method=method, metrics={"points": 1000})
    found = told(capsys, tmp_path / "before", tmp_path / "after", status=0)  # the artifacts named do not lie there
    assert found["why"] == [
        {"stage": "phase", "text": "parameter method: 'thesis' → 'joint'", "scans": ["rock1", "rock2"]}
    ]
    diff(tmp_path / "before", tmp_path / "after")
    assert "phase: parameter method: 'thesis' → 'joint' (all 2 rows)" in capsys.readouterr().out


def test_records_of_another_version_tell_no_why(before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in (after / "results").glob("*/provenance/*.json"):
        write_json(path, {**read_json(path), "schema": 0})
    rewrite(after / "results" / "rock1" / "cloud.zarr", lambda arrays: arrays.update(z_std=arrays["z_std"] * 2))
    found = row(told(capsys, before, after))
    assert found["artifacts"] == {"cloud.zarr": "changed"}
    assert [note.split(":")[0] for note in found["notes"]] == ["why is not known"]


@pytest.fixture
def with_history(tmp_path: Path) -> Path:
    """Three runs; the parameter and a number changed with the second, another row's verdict with the third."""
    root = tmp_path / "kept"
    results = root / "results"
    rows = ("rock1", "rock2")
    for scan_id in rows:
        write_row(results, scan_id, method="thesis", metrics={"points": 1000, "periods": 1.62})
    keep_run(results, rows)
    write_row(results, "rock1", method="joint", metrics={"points": 1200, "periods": 1.62})
    keep_run(results, rows)
    write_row(results, "rock2", verdict="rejected", method="thesis", metrics={"points": 1000, "periods": 1.62})
    keep_run(results, rows)
    return root


def test_what_a_number_used_to_be(with_history: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = told(capsys, "0001", "-1", "--expedition", with_history)
    assert (found["before"]["name"], found["after"]["name"]) == ("run 0001", "run 0002")
    assert found["before"]["made"].keys() == {"time", "host", "commit", "tree_clean"}
    assert row(found)["metrics"] == {"points": [1000, 1200]}
    assert row(found)["artifacts"] == dict.fromkeys(("cloud.json", "phase.json", "timeline.json"), "changed")
    assert [why["text"] for why in found["why"]] == ["parameter method: 'thesis' → 'joint'"]
    assert not row(found, "rock2")["differs"]
    assert row(told(capsys, "2", "latest", "--expedition", with_history), "rock2")["verdict"] == [
        "accepted",
        "rejected",
    ]
    told(capsys, "latest", "3", "--expedition", with_history, status=0)


def test_a_run_against_the_folder_of_now(with_history: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert diff("0001", with_history, "--expedition", with_history) == 1
    out = capsys.readouterr().out
    assert "points: 1000 → 1200  (+200)" in out
    assert "numbers and digests only" in out


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("0007", "no such run"),
        ("-3", "no such run"),
        ("nowhere", "found no such folder"),
        ("empty", "found no results in it"),
    ],
)
def test_sides_that_are_none(
    with_history: Path, name: str, why: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(with_history)
    (with_history / "empty").mkdir()
    assert diff(name, ".") == 2
    assert why in capsys.readouterr().err


def test_other_refusals(before: Path, with_history: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert diff(before, "latest", "--expedition", before) == 2
    assert "no run is kept" in capsys.readouterr().err
    assert diff(before, before, "--page", before / "results" / "rock1" / "qa.json" / "page.html") == 2
    (with_history / "results" / "history" / "0002.json.gz").write_bytes(b"none")
    assert diff("0001", "0002", "--expedition", with_history) == 2
    assert "0002.json.gz" in capsys.readouterr().err


def test_a_store_that_cannot_be_read_is_said_to_be(
    before: Path, after: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def narrow(arrays: dict[str, np.ndarray]) -> None:
        arrays |= {name: values[:, :100] for name, values in arrays.items()}

    def move(arrays: dict[str, np.ndarray]) -> None:
        arrays["xyz"] += np.float32(1.0)

    rewrite(after / "results" / "rock1" / "phase.zarr", narrow)
    cloud = after / "results" / "rock1" / "cloud.zarr"
    rewrite(cloud, move)
    chunk = next((cloud / "xyz" / "c").rglob("0"))
    while chunk.is_dir():
        chunk = chunk / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    notes = " ".join(row(told(capsys, before, after))["notes"])
    assert "phase cannot be compared: the grids differ: (96, 128) before, (96, 100) after" in notes
    assert "depth cannot be compared: " in notes
