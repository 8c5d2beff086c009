"""Slide, lens or rig changed between calibration and scan: said with its cause and size; sound pairs stay quiet."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rahas.simulate.examples import example
from rahas.stores.arrays import open_store
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from tests.chain.bench import film, process, write_target

AIMED_DEG = float(np.rad2deg(np.arctan2(200.0, 610.0)))


class Bench(NamedTuple):
    root: Path
    calibration: ScanFolder


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    root = tmp_path_factory.mktemp("changes")
    path, _ = film(root / "captures", "cal", example("roof", seed=5, short=True))
    calibration = ScanFolder(root / "results", "cal")
    assert process(calibration, path, target=write_target(root / "target.csv")).verdict == "accepted"
    return Bench(root, calibration)


def scanned(bench: Bench, name: str, **changes: Any) -> tuple[dict[str, Any], list[str], list[str], float]:
    """Comparison with the calibration, messages of warnings and of reasons, true rms depth error in mm."""
    path, truth = film(bench.root / "captures", name, example("circle", seed=7, short=True, **changes))
    scan = ScanFolder(bench.root / "results", name)
    done = process(scan, path, calibration=bench.calibration)
    cloud = open_store(scan.cloud)
    lit = truth["lit"] & (truth["albedo"] > 0.1)
    error = (cloud["xyz"][..., 2] - truth["world_target"][..., 2])[lit]
    warnings = [w["message"] for w in read_json(scan.result_review)["warnings"] if w["rule"] == "calibration"]
    rms = float(np.sqrt(np.nanmean(error**2)))
    return dict(cloud.attrs)["calibration_consistency"], warnings, [r["message"] for r in done.reasons], rms


@pytest.mark.parametrize("encoding", [{}, {"codec": "h264", "crf": 26}])
def test_a_sound_pair_stays_quiet(bench: Bench, encoding: dict[str, Any]) -> None:
    found, warnings, reasons, _ = scanned(bench, f"clean{len(encoding)}", encoding=encoding)
    assert (warnings, reasons, found["cause"]) == ([], [], "")
    assert abs(found["offset_rad"]) < 0.006
    assert found["gradient_rad"] < 0.012
    assert 1e-4 < found["offset_std_rad"] < 3e-3


def test_a_slide_seated_otherwise(bench: Bench) -> None:
    found, warnings, reasons, rms = scanned(bench, "shift", rig={"slide_shift_rad": 0.1})
    assert reasons == []
    assert found["offset_rad"] == pytest.approx(0.1, abs=0.004)
    assert found["cause"] == "slide_shift"
    assert found["depth_mm"] == pytest.approx(rms, rel=0.1)
    assert len(warnings) == 1
    assert "holder" in warnings[0]


def test_a_projector_turned_up(bench: Bench) -> None:
    found, _, reasons, rms = scanned(bench, "pitch", rig={"toe_in_deg": AIMED_DEG + 0.3})
    assert found["cause"] == "projector_pitch"
    assert abs(found["changes"]["projector_pitch"]) == pytest.approx(0.3, rel=0.25)
    assert found["depth_mm"] == pytest.approx(rms, rel=0.3)
    assert len(reasons) == 1
    assert "up or down" in reasons[0]


def test_another_zoom(bench: Bench) -> None:
    found, warnings, _, rms = scanned(bench, "zoom", rig={"focal_widths": 2.03 * 1.005})
    assert found["cause"] == "camera_zoom"
    assert abs(found["changes"]["camera_zoom"]) == pytest.approx(0.005, rel=0.1)
    assert found["depth_mm"] == pytest.approx(rms, rel=0.15)
    assert "zoom" in warnings[0]
