"""Another rig, from a fresh folder, by the command line: nothing is told of it but its target."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rahas.simulate.examples import SHORT_HAND, example
from rahas.stores.arrays import open_store
from rahas.stores.layout import ScanFolder
from tests.chain.accuracy import MIN_ALBEDO, score_depth, score_phase
from tests.chain.bench import Truth, film, write_target
from tests.chain.command_line import run_snakemake, verdict_of

RIG: dict[str, Any] = {
    "width_px": 640,
    "height_px": 480,
    "stripes": 16,
    "baseline_mm": 150.0,
    "working_distance_mm": 540.0,
    "focal_widths": 1.9,
    "centre_u": -0.02,
    "centre_v": 0.015,
    "crank": "translation",
}
INTERLACED: dict[str, Any] = {"camera": {"fields": "top_first"}, "encoding": {"codec": "mpeg2", "quantiser": 2}}
PICTURES: dict[str, Any] = {"encoding": {"codec": "png"}, "hand": {**SHORT_HAND, "dark_before_s": 0.0}}
LOG = """scan_id;site;decision;notes;role
rigCal;quarry;;target, one shot;calibration
tape;quarry;;"tape; interlaced";scan
stills;quarry;keep;frame grabs;
"""


class OtherRig(NamedTuple):
    root: Path
    truth: dict[str, Truth]
    said: str


@pytest.fixture(scope="module")
def other_rig(tmp_path_factory: pytest.TempPathFactory) -> OtherRig:
    root = tmp_path_factory.mktemp("other rig") / "my expedition"
    write_target(root / "config" / "target.csv")
    (root / "field_log.csv").write_text(LOG, encoding="utf-8")
    common: dict[str, Any] = {"rig": RIG, "hand": SHORT_HAND}
    captures = {
        "rigCal": example("roof", seed=11, **{**common, **INTERLACED}),
        "tape": example("monkey", seed=12, **{**common, **INTERLACED}),
        "stills": example("circle", seed=13, **{**common, **PICTURES}),
    }
    truth = {scan_id: film(root / "captures", scan_id, capture)[1] for scan_id, capture in captures.items()}
    before = {path: path.stat().st_mtime_ns for path in (root / "captures").rglob("*")}
    said = run_snakemake(root)
    assert {path: path.stat().st_mtime_ns for path in (root / "captures").rglob("*")} == before
    return OtherRig(root, truth, said)


def test_all_three_are_accepted(other_rig: OtherRig) -> None:
    verdicts = {scan_id: verdict_of(other_rig.root, scan_id) for scan_id in other_rig.truth}
    assert verdicts == {"rigCal": "accepted", "tape": "accepted", "stills": "accepted"}
    assert (other_rig.root / "results" / "index.html").is_file()


def test_kinds_of_capture_are_recognised(other_rig: OtherRig) -> None:
    results = other_rig.root / "results"
    orders = {s: open_store(ScanFolder(results, s).frames).attrs["field_order"] for s in other_rig.truth}
    assert orders == {"rigCal": "top_first", "tape": "top_first", "stills": "progressive"}


@pytest.mark.parametrize(("scan_id", "median_mm", "rms_mm"), [("tape", 0.12, 0.25), ("stills", 0.10, 0.2)])
def test_clouds_against_truth(other_rig: OtherRig, scan_id: str, median_mm: float, rms_mm: float) -> None:
    scan, truth = ScanFolder(other_rig.root / "results", scan_id), other_rig.truth[scan_id]
    lit = truth["lit"] & (truth["albedo"] > MIN_ALBEDO)
    phase = score_phase(scan, truth["unwrapped_phase"], lit)
    depth = score_depth(scan, truth["world_target"], lit)
    print(f"{scan_id}: {phase}\n{scan_id}: {depth}")
    assert phase.wrong_orders <= 0.001
    assert depth.coverage >= 0.95
    assert 0.02 < depth.median_mm <= median_mm
    assert depth.rms_mm <= rms_mm
    assert 0.8 <= depth.normalised_68 <= 1.35
