"""`rahas export` on a processed expedition: the crate tells the files as they are and their way from the captures."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from urllib.parse import unquote

import pytest
from rocrate.rocrate import ROCrate

from rahas import cli
from rahas.provenance.crate import METADATA
from rahas.stores.digests import digest_of_file
from rahas.tasks.export import TABLE
from tests.provenance.profile import CHECKS, Graph, graph_of, links, of_type, run_of, steps_done
from tests.workflow.expedition import Expedition


def exported(expedition: Expedition, *more: str) -> Graph:
    folder = Path(more[1]) if more else expedition.root
    assert cli.main(["export", "--expedition", str(expedition.root), *more]) == 0
    return graph_of(json.loads((folder / METADATA).read_text(encoding="utf-8")))


def test_export(finished: Expedition) -> None:
    """The profile is kept, digests and sizes are those of the files, and all files of the results are told of."""
    graph = exported(finished)
    assert all(answer for check in CHECKS for answer in check(graph))
    for entity in of_type(graph, "File"):
        path = finished.root / unquote(entity["@id"])
        assert digest_of_file(path) == entity["sha256"], path
        assert "contentSize" not in entity or int(entity["contentSize"]) == path.stat().st_size
    scans = [finished.scan(scan_id) for scan_id in ("cal", "rock", "far")]
    artifacts = {p for scan in scans for p in scan.rglob("*") if p.is_file() and "provenance" not in p.parts}
    stores = {finished.root / unquote(entity["@id"]) for entity in of_type(graph, "Dataset")}
    in_stores = {p for p in artifacts if stores & set(p.parents)}
    assert artifacts - in_stores <= {finished.root / unquote(e["@id"]) for e in of_type(graph, "File")}
    assert all("startTime" in done and "endTime" in done for done in steps_done(graph))
    assert not [e["@id"] for e in graph.values() if e["@id"].startswith("#former/")]


def test_the_way_from_the_captures(finished: Expedition) -> None:
    graph = exported(finished)
    maker = {one: action for action in steps_done(graph) for one in links(action, "result")}
    reached, pending = set(), ["results/rock/cloud.ply"]
    while pending:
        here = pending.pop()
        reached.add(here)
        pending += [one for one in links(maker.get(here, {}), "object") if one not in reached]
    raw = {one for one in reached if not one.startswith(("#", "results/"))}
    assert raw == {
        *("captures/rock.mkv", "captures/rock_texture.png", "captures/cal.mkv", "captures/cal_texture.png"),
        "config/target.csv",
    }
    assert {"results/cal/calibration.json", "results/rock/phase.zarr/"} <= reached
    assert raw <= set(links(run_of(graph), "object"))
    assert "captures/far.mkv" not in reached


def test_same_crate_elsewhere(finished: Expedition, tmp_path: Path) -> None:
    """A copy without times and without Snakemake's own folder exports the same bytes."""
    exported(finished)
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(finished.root, elsewhere, copy_function=shutil.copyfile)
    shutil.rmtree(elsewhere / ".snakemake")
    for name in (METADATA, TABLE):
        (elsewhere / name).unlink()
    exported(Expedition(elsewhere, finished.code))
    for name in (METADATA, TABLE):
        assert (elsewhere / name).read_bytes() == (finished.root / name).read_bytes(), name


def test_read_back(finished: Expedition) -> None:
    graph = exported(finished)
    read = ROCrate(finished.root)
    assert {one.id for one in read.get_entities()} == set(graph)
    phase = read.dereference("#action/rock/phase")
    assert "results/cal/snakes.zarr/" in {one.id for one in phase["object"]}
    with open(finished.root / TABLE, encoding="utf-8", newline="") as file:
        rows = {(row["scan_id"], row["stage"]): row for row in csv.DictReader(file)}
    assert len(rows) == len(steps_done(graph))
    assert rows["rock", "cloud"]["outputs"] == "results/rock/cloud.zarr\nresults/rock/cloud.ply"
    assert rows["rock", "cloud"]["started"] == read.dereference("#action/rock/cloud")["startTime"]


def test_folder_of_its_own(finished: Expedition, tmp_path: Path) -> None:
    graph = exported(finished, "--output", str(tmp_path / "crate"))
    assert all(answer for check in CHECKS for answer in check(graph))
    ply = graph["../expedition/results/rock/cloud.ply"]
    assert digest_of_file(tmp_path / "crate" / unquote(ply["@id"])) == ply["sha256"]
    assert not (finished.root / METADATA).exists()


def test_nothing_made_yet(rendered: Expedition, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["export", "--expedition", str(rendered.root)]) == 2
    assert "run snakemake first" in capsys.readouterr().err
    assert not (rendered.root / METADATA).exists()
