"""What a capture can do to the chain: short captures at half size, several faults in each, against truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rahas.simulate.examples import example
from rahas.simulate.specs import PauseSpec
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from tests.chain.accuracy import MIN_ALBEDO, score_depth, score_phase, score_snakes, timeline_errors
from tests.chain.bench import film, process, write_target


class Rough(NamedTuple):
    """A capture, and what it may cost: a clean one has a median of 0.073 mm, an rms of 0.115 mm."""

    fields: dict[str, Any]
    median_mm: float
    rms_mm: float
    coverage: float = 0.97
    normalised_68: float = 1.25


PAUSES = (PauseSpec(at=0.3, length=0.15), PauseSpec(at=0.6, length=0.1, back=0.5))
ODD_RIG: dict[str, Any] = {
    "width_px": 240,
    "height_px": 360,
    "focal_widths": 2.6,
    "baseline_tilt_deg": 3.0,
    "radial_k1": -0.1,
    "first_stop_deg": 1.0,
    "second_stop_deg": 90.8,
}
ROUGH = {
    "three periods with a stall and a slip back, no dark frames, full range": Rough(
        {
            "hand": {"dark_before_s": 0.0, "dark_after_s": 0.0, "periods": 3.0, "crank_s": 3.0, "pauses": PAUSES},
            "camera": {"luma_range": "full"},
        },
        median_mm=0.08,
        rms_mm=0.13,
    ),
    "gamma 2.2, flicker, stray light that drifts": Rough(
        {"camera": {"gamma": 2.2, "flicker": 0.02, "ambient": 0.03, "ambient_drift": 0.3}},
        median_mm=0.11,
        rms_mm=0.17,
        normalised_68=1.35,
    ),
    "doubled and lost frames, auto-exposure, less than a period": Rough(
        {
            "camera": {"doubled": (40, 41, 90, 135, 140), "dropped": (60, 61, 128), "auto_exposure": 0.3},
            "hand": {"periods": 0.97},
        },
        median_mm=0.12,
        rms_mm=0.19,
        normalised_68=1.5,
    ),
    "H.264, crank upwards, tremor": Rough(
        {"encoding": {"codec": "h264", "crf": 12}, "hand": {"periods": -1.5, "tremor_px": 0.15}},
        median_mm=0.18,
        rms_mm=0.29,
        normalised_68=1.6,
    ),
    "portrait, tilted baseline, distortion, stops off": Rough(
        {"rig": ODD_RIG}, median_mm=0.10, rms_mm=0.16, coverage=0.9
    ),
}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rough")


@pytest.fixture(scope="module")
def calibrations(bench: Path) -> dict[str, ScanFolder]:
    """The usual rig's and the odd one's."""
    scans = {}
    for name, rig in (("usual", {}), ("odd", ODD_RIG)):
        scans[name] = ScanFolder(bench / "results", f"cal_{name}")
        path, _ = film(bench / "captures", f"cal_{name}", example("roof", short=True, seed=3, rig=rig))
        done = process(scans[name], path, target=write_target(bench / "target.csv"))
        assert done.verdict == "accepted", done.why
    return scans


@pytest.mark.parametrize("name", ROUGH)
def test_accepted_and_right(bench: Path, calibrations: dict[str, ScanFolder], name: str) -> None:
    rough, number = ROUGH[name], list(ROUGH).index(name)
    capture = example("circle", short=True, seed=3, **rough.fields)
    path, truth = film(bench / "captures", f"rough_{number}", capture)
    calibration = calibrations["usual" if capture.rig.width_px > capture.rig.height_px else "odd"]
    done = process(ScanFolder(bench / "results", f"rough_{number}"), path, calibration=calibration)
    assert done.verdict == "accepted", done.why
    for stage, first, last in timeline_errors(done.scan, truth):
        assert max(abs(first), abs(last)) <= 2, (stage, first, last)
    lit = truth["lit"] & (truth["albedo"] > MIN_ALBEDO)
    phase = score_phase(done.scan, truth["unwrapped_phase"], lit)
    depth = score_depth(done.scan, truth["world_target"], lit)
    snakes = score_snakes(done.scan, capture.rig, truth, every=6)
    print(f"{name}: {phase}\n{name}: {depth}\n{name}: {snakes}")
    assert phase.wrong_orders <= 0.001
    assert depth.coverage >= rough.coverage
    assert 0.02 < depth.median_mm <= rough.median_mm
    assert depth.rms_mm <= rough.rms_mm
    assert 0.8 <= depth.normalised_68 <= rough.normalised_68
    assert snakes.swapped == 0
    assert snakes.p95_px <= 0.8


def test_too_short_a_crank_is_rejected(bench: Path, calibrations: dict[str, ScanFolder]) -> None:
    capture = example("circle", short=True, seed=3, hand={"periods": 0.8})
    path, _ = film(bench / "captures", "short", capture)
    done = process(ScanFolder(bench / "results", "short"), path, calibration=calibrations["usual"])
    assert done.verdict == "timeline"
    assert done.reasons[0]["metric"] == "periods"
    assert done.reasons[0]["value"] == pytest.approx(0.8, abs=0.02)
    assert not done.scan.phase.exists()
    assert read_json(done.scan.timeline)["periods"] == pytest.approx(0.8, abs=0.02)
