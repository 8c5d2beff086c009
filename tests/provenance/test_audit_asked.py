"""What an audit answers when it is asked of one artifact: lineage, dependents, reasons; table, JSON, exit status."""

from __future__ import annotations

import json

import pytest

from rahas.cli import main
from rahas.errors import ExpeditionError
from tests.provenance.tree import Tree


def test_one_artifact_is_audited_with_all_before_it_and_nothing_else(tree: Tree) -> None:
    (tree.results / "cal" / "calibration.json").write_text("{}")
    (tree.results / "rock" / "report.html").write_text("")
    (told,) = tree.audit("results/rock/cloud.ply").findings
    assert told.artifact == "results/cal/calibration.json"
    assert tree.audit("results/rock2/phase.zarr").findings == []
    assert {f.artifact for f in tree.audit("rock").findings} == {
        "results/cal/calibration.json",
        "results/rock/report.html",
    }


def test_names_are_read_as_people_write_them(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tree.results / "rock")
    for name in ("cloud.ply", str(tree.results / "rock" / "cloud.ply"), "results/rock/cloud.ply"):
        assert tree.audit(name).artifacts == tree.audit("results/rock/cloud.ply").artifacts > 0
    for name in ("nothing", "../../../elsewhere", "results/rock/cloud.stl", "/etc/passwd"):
        with pytest.raises(ExpeditionError, match="expected a scan_id"):
            tree.audit(name)


def test_dependents(tree: Tree) -> None:
    def of(name: str) -> set[str]:
        found = tree.audit(name, show_dependents=True).dependents
        assert found is not None
        return set(found[name])

    assert {"results/rock/cloud.ply", "results/rock2/cloud.ply", "results/made/cloud.ply"} <= of("config/target.csv")
    assert not {"results/rock/phase.zarr", "results/cal/phase.zarr"} & of("config/target.csv")
    assert {"results/rock/phase.zarr", "results/rock2/cloud.zarr"} <= of("cal")
    assert "results/rock2/frames.zarr" not in of("cal")
    assert {name.split("/")[1] for name in of("captures/rock.mkv")} == {"rock", "index.html", "scans.csv"}
    assert of("results/rock/cloud.ply") >= {"results/rock/review/result.json", "results/rock/qa.json"}
    assert "results/rock/cloud.zarr" not in of("results/rock/cloud.ply")
    assert "captures/simulated/made.mkv" in of("config/simulation.yaml")


def test_explanation_reaches_raw_files_and_says_when(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    tree.configure("cloud:\n  normal_radius_px: 5\n")
    assert main(["audit", "--explain", "results/rock/cloud.ply", "--expedition", str(tree.root)]) == 1
    out = capsys.readouterr().out
    for expected in ("captures/rock.mkv", "captures/cal.mkv", "captures/rock_texture.png", "config/target.csv"):
        assert expected in out
    assert "by EC" in out
    assert "! stale: parameter normal_radius_px: 2 → 5" in out
    assert "20" in out.partition("results/rock/phase.zarr")[2]
    assert out.count("results/rock/frames.zarr  ← ingest\n") == 1
    assert "(drawn above)" in out


def test_why_a_scan_was_rejected(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["audit", "far", "lost", "--expedition", str(tree.root)]) == 0
    out = capsys.readouterr().out
    assert "far: rejected\n  object_span: " in out
    assert "lost: rejected\n  unreadable: There is no capture lost.mkv" in out


def test_exit_status_and_table(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    root = str(tree.root)
    assert main(["audit", "--expedition", root]) == 0
    assert capsys.readouterr().out.strip() == f"8 scans, {tree.audit().artifacts} artifacts, 0 findings"
    (tree.results / "rock" / "phase.zarr" / "quality" / "c" / "0" / "0").write_bytes(b"")
    assert main(["audit", "--expedition", root]) == 1
    out = capsys.readouterr().out
    assert "results/rock/phase.zarr  chunk 0/0 of quality is not what was written (it is empty)" in out
    assert main(["audit", "nobody", "--expedition", root]) == 2
    (tree.root / "config" / "config.yaml").write_text("clouds: {}\n", encoding="utf-8")
    assert main(["audit", "--expedition", root]) == 2


def test_json(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    tree.configure("cloud:\n  deband: false\n")
    assert main(["audit", "rock", "--json", "--explain", "--expedition", str(tree.root)]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["clean"] is False
    assert told["verdicts"]["rock"]["verdict"] == "accepted"
    finding = told["findings"][0]
    assert (finding["kind"], finding["artifact"]) == ("stale", "results/rock/cloud.zarr")
    assert finding["changes"] == [
        {"kind": "parameter", "name": "deband", "was": True, "now": False, "text": "parameter deband: True → False"}
    ]
    assert told["lineage"][0]["scan"] == "rock"
