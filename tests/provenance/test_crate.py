"""The crate fits its profile, says no more than the records, and is read by the library that others use."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from rocrate.rocrate import ROCrate

from rahas.provenance.action_table import COLUMNS, action_table
from rahas.provenance.actions import Action, Artifact
from rahas.provenance.crate import METADATA, Facts, crate_text
from tests.provenance.profile import CHECKS, Graph, graph_of, links, steps_done

A, B, C, D, E = (letter * 64 for letter in "abcde")
VIDEO = Artifact("captures/rock 1.mkv", A, size=7)
FRAMES = Artifact("results/rock/frames.zarr", B, folder=True, size=90)
PHASE = Artifact("results/rock/phase.zarr", C, folder=True, size=80)
FACTS = Facts(
    name="RAHAS expedition Tara",
    description="2 captures.",
    published="2026-11-22",
    version="0.1.0",
    engine="9.27.1",
    workflow=Artifact("./ro-crate-workflow.smk", E, size=1),
    settings=(Artifact("field_log.csv", D, size=5),),
    table=Artifact("./ro-crate-actions.csv", E, size=2),
    stages=("ingest", "phase"),
)


def action(scan_id: str, stage: str, **changes: Any) -> Action:
    whole: dict[str, Any] = {
        "scan_id": scan_id, "stage": stage, "entry": f"rahas.tasks.{stage}:run", "outcome": "made", "inputs": (),
        "outputs": (), "parameters": {}, "code": A, "libraries": {"numpy": "2.4.6"}, "rahas": "0.1.0",
    }  # fmt: skip
    return Action(**(whole | changes))


INGEST = action("rock", "ingest", inputs=(VIDEO,), outputs=(FRAMES,), parameters={"frame_rate": None})
PHASING = action(
    "rock",
    "phase",
    inputs=(FRAMES,),
    outputs=(PHASE,),
    parameters={"method": "joint", "field_log.role": "scan"},
    code=B,
)
OTHER = action(
    "far", "ingest", inputs=(VIDEO._replace(path="captures/far.mkv"),), outcome="problem",
    message="The video cannot be decoded.", parameters={"frame_rate": 25.0},
    began="2026-11-22T08:00:17+00:00", ended="2026-11-22T08:00:19+00:00", host="field-laptop", commit="c0ffee",
)  # fmt: skip
ACTIONS = (INGEST, PHASING, OTHER)


def crate(actions: tuple[Action, ...] = ACTIONS, prefix: str = "") -> Graph:
    return graph_of(json.loads(crate_text(FACTS, actions, prefix=prefix)))


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_profile(check: Callable[[Graph], Iterator[bool]]) -> None:
    answers = list(check(crate()))
    assert answers
    assert all(answers)


def fits(graph: Graph) -> bool:
    try:
        return all(answer for check in CHECKS for answer in check(graph))
    except (KeyError, ValueError):
        return False


def _without(identifier: str, name: str) -> Callable[[Graph], object]:
    return lambda graph: graph[identifier].pop(name)


@pytest.mark.parametrize(
    "damage",
    [
        _without("#action/rock/phase", "instrument"),
        _without("#control/rock/phase", "object"),
        _without("#step/phase", "workExample"),
        _without("#engine-run", "result"),
        _without("./", "mainEntity"),
        _without("./", "license"),
        _without("ro-crate-workflow.smk", "hasPart"),
        lambda graph: graph["#input/phase/method"].pop("additionalType"),
        lambda graph: graph["./"]["hasPart"].pop(),
        lambda graph: graph["./"]["conformsTo"].pop(2),
        lambda graph: graph["ro-crate-workflow.smk"]["@type"].remove("HowTo"),
        lambda graph: graph["#step/phase"].update(position="0"),
        lambda graph: graph.pop("results/rock/phase.zarr/"),
        lambda graph: graph.pop("#control/far/ingest"),
    ],
)
def test_the_checklist_finds_faults(damage: Callable[[Graph], object]) -> None:
    graph = crate()
    assert fits(graph)
    damage(graph)
    assert not fits(graph)


def test_terms_are_defined() -> None:
    """A property that the context does not define would be dropped without a word."""
    known = json.loads((files("rocrate.data") / "ro-crate.jsonld").read_text(encoding="utf-8"))["@context"]
    graph = crate()
    used = {name for entity in graph.values() for name in entity} - {"@id", "@type"}
    kinds = {
        kind
        for entity in graph.values()
        for kind in (entity["@type"] if isinstance(entity["@type"], list) else [entity["@type"]])
    }
    assert used | kinds <= set(known)


def test_what_was_done() -> None:
    graph = crate()
    done = graph["#action/rock/phase"]
    assert links(done, "object") == ["results/rock/frames.zarr/", *links(done, "object")[1:]]
    values = {graph[one]["name"]: graph[one]["value"] for one in links(done, "object")[1:]}
    assert values == {"method": "joint", "field_log.role": "scan"}
    assert links(done, "result") == ["results/rock/phase.zarr/"]
    tool = graph[links(done, "instrument")[0]]
    assert tool["softwareVersion"] == f"0.1.0+{B[:12]}"
    assert tool["identifier"] == f"sha256:{B}"
    assert {graph[one]["name"]: graph[one]["softwareVersion"] for one in links(tool, "softwareRequirements")} == {
        "numpy": "2.4.6"
    }
    assert "startTime" not in done
    failed = graph["#action/far/ingest"]
    assert failed["error"] == "The video cannot be decoded."
    assert (failed["startTime"], failed["endTime"]) == (OTHER.began, OTHER.ended)
    assert "field-laptop" in failed["description"]
    assert "c0ffee" in failed["description"]


def test_files_and_stores() -> None:
    graph = crate(prefix="../")
    assert graph["../captures/rock%201.mkv"]["sha256"] == A
    assert graph["../captures/rock%201.mkv"]["contentSize"] == "7"
    store = graph["../results/rock/frames.zarr/"]
    assert store["contentSize"] == "90"
    assert graph[links(store, "hasPart")[0]]["sha256"] == B
    assert links(store, "hasPart") == ["../results/rock/frames.zarr/manifest.json"]
    assert "ro-crate-workflow.smk" in graph


def test_versions_of_code_are_tools_of_their_own() -> None:
    """Scans made by different code, libraries or parameters do not share them."""
    newer = action("far", "ingest", code=D, libraries={"numpy": "2.4.7"}, parameters={"frame_rate": 25.0})
    graph = crate((INGEST, newer))
    tools = {scan: links(graph[f"#action/{scan}/ingest"], "instrument")[0] for scan in ("rock", "far")}
    assert len(set(tools.values())) == 2
    assert set(links(graph["#step/ingest"], "workExample")) == set(tools.values())
    values = [graph[links(graph[f"#action/{scan}/ingest"], "object")[-1]]["value"] for scan in ("rock", "far")]
    assert values == ["null", 25.0]
    assert graph["#input/ingest/frame_rate"]["additionalType"] == "Float"
    assert fits(graph)


def test_replaced_bytes_are_not_taken_for_those_that_were_read() -> None:
    stale = PHASING._replace(inputs=(FRAMES._replace(sha256=D),))
    graph = crate((INGEST, stale))
    read = links(graph["#action/rock/phase"], "object")[0]
    assert read.startswith("#former/results/rock/frames.zarr/")
    assert graph[read]["identifier"] == f"sha256:{D}"
    assert fits(graph)


def test_same_text_for_the_same_records() -> None:
    text = crate_text(FACTS, ACTIONS)
    reordered = PHASING._replace(parameters=dict(reversed(list(PHASING.parameters.items()))))
    assert crate_text(FACTS, (INGEST, reordered, OTHER)) == text
    assert crate_text(FACTS, (INGEST, PHASING._replace(code=C), OTHER)) != text


def test_read_by_the_library(tmp_path: Path) -> None:
    (tmp_path / METADATA).write_text(crate_text(FACTS, ACTIONS), encoding="utf-8")
    for name in ("ro-crate-workflow.smk", "ro-crate-actions.csv", "field_log.csv"):
        (tmp_path / name).write_text("", encoding="utf-8")
    read = ROCrate(tmp_path)
    assert read.mainEntity.id == "ro-crate-workflow.smk"
    assert {"File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo"} == set(read.mainEntity.type)
    done = read.dereference("#action/rock/phase")
    assert [one.id for one in done["result"]] == ["results/rock/phase.zarr/"]
    assert done["instrument"]["softwareVersion"] == f"0.1.0+{B[:12]}"
    assert len([one for one in read.get_entities() if one.type == "CreateAction"]) == 4


def test_table_says_the_same() -> None:
    graph = crate()
    rows = list(csv.DictReader(io.StringIO(action_table(ACTIONS), newline="")))
    assert tuple(rows[0]) == COLUMNS
    assert {f"#action/{row['scan_id']}/{row['stage']}" for row in rows} == {a["@id"] for a in steps_done(graph)}
    phasing = rows[1]
    assert (phasing["inputs"], phasing["input_sha256"]) == (FRAMES.path, B)
    assert (phasing["outputs"], phasing["output_sha256"]) == (PHASE.path, C)
    assert json.loads(phasing["parameters"]) == dict(PHASING.parameters)
    assert (rows[2]["started"], rows[2]["ended"], rows[2]["message"]) == (OTHER.began, OTHER.ended, OTHER.message)
    assert rows[0]["started"] == ""
