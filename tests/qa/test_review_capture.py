"""The first gate's measurements on plain synthetic captures, and its task on stores."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rahas.kernels.jitter import jitter_from_displacement
from rahas.params import CaptureReviewParams
from rahas.stages.review_capture import review_capture
from rahas.stores.arrays import writing_store
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder
from rahas.tasks import review

from .scene import Capture, Scene, bump, film

ATTRIBUTES = {"bit_depth": 8, "interlaced": False, "field_order": "progressive", "luma_range": "full"}
FRAMES = 161
IN_SCAN = 95


def measured(capture: Capture, **attributes: Any) -> dict[str, Any]:
    return review_capture(
        capture.frames,
        time_s=capture.time_s,
        attributes=ATTRIBUTES | attributes,
        timeline=capture.timeline,
        params=CaptureReviewParams(),
    ).metrics


def true_jitter(capture: Capture) -> float:
    jitter = jitter_from_displacement(capture.displacement[capture.moving], capture.time_s[capture.moving])
    assert jitter is not None
    return jitter


@pytest.mark.parametrize(
    "scene", [Scene(), Scene(flicker=0.03, seed=2), Scene(pitch=15.0), Scene(pitch=40.0), Scene(noise=4.0, light=60.0)]
)
def test_a_still_capture_has_no_jitter(scene: Scene) -> None:
    metrics = measured(film(scene))
    assert metrics["jitter"] < 0.15
    assert metrics["pitch_px"] == pytest.approx(scene.pitch, rel=0.03)
    assert metrics["object_span"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("amplitude", "start"), [(0.5, 50), (2.0, 40), (5.0, 60), (0.8, IN_SCAN), (3.0, IN_SCAN), (5.0, IN_SCAN)]
)
def test_jitter_is_measured_within_a_tenth(amplitude: float, start: int) -> None:
    capture = film(Scene(), bump(FRAMES, start=start, amplitude=amplitude))
    assert measured(capture)["jitter"] == pytest.approx(true_jitter(capture), rel=0.10, abs=0.05)


def test_jitter_needs_texture() -> None:
    capture = film(Scene(texture=0.0), bump(FRAMES, start=50, amplitude=3.0))
    assert measured(capture)["jitter"] is None


def test_interlaced_frames_are_measured_by_their_first_field() -> None:
    full = film(Scene(height=480), bump(FRAMES, start=50, amplitude=3.0))
    later = np.roll(full.frames, -1, axis=0)
    woven = full.frames.copy()
    woven[:, 1::2] = later[:, 1::2]
    interlaced = Capture(woven, full.time_s, full.timeline, full.displacement)
    metrics = measured(interlaced, interlaced=True, field_order="top_first")
    assert metrics["jitter"] == pytest.approx(true_jitter(full), rel=0.10, abs=0.05)


@pytest.mark.parametrize("span", [0.2, 0.45, 0.55, 0.8])
def test_object_span_before_a_faint_background(span: float) -> None:
    metrics = measured(film(Scene(span=span, surroundings=0.04)))
    assert metrics["object_span"] == pytest.approx(span, abs=0.01)
    assert metrics["jitter"] is None or metrics["jitter"] < 0.5


def test_exposure_and_contrast() -> None:
    bright = measured(film(Scene(light=300.0)))
    assert bright["clipped_high_share"] > 0.2
    assert bright["clipped_low_share"] == 0.0
    weak = measured(film(Scene(modulation=0.08)))
    assert weak["contrast"] < 5.0
    fair = measured(film(Scene(modulation=0.5, noise=2.0)))
    sigma = 2.0 * np.sqrt(1.0 + 45.0 / 100.0)
    assert fair["contrast"] == pytest.approx(0.5 * 45.0 * 0.97 / sigma, rel=0.15)
    assert fair["clipped_share"] == 0.0


def test_task_writes_the_review_and_the_verdict(tmp_path: Path) -> None:
    scan = ScanFolder(tmp_path, "shaken")
    capture = film(Scene(), bump(FRAMES, start=50, amplitude=4.0))
    with writing_store(scan.frames, **ATTRIBUTES, damage=[]) as store:
        store.put("frames", ("frame", "y", "x"), capture.frames, chunks=(8, *capture.frames.shape[1:]))
        store.put("time_s", ("frame",), capture.time_s)
    write_json(scan.timeline, capture.timeline)
    review.run_capture(scan, role="scan", params=CaptureReviewParams())
    content = read_json(scan.capture_review)
    assert [reason["rule"] for reason in content["reasons"]] == ["jitter"]
    series = content["series"]["displacement_px"]
    assert len(series) == FRAMES
    assert series[0] is None
    assert series[50][0] - series[40][0] == pytest.approx(4.0, abs=0.3)
    review.write_verdict(scan, decision="keep", role="scan", processed=True, overridden=False, problem=None)
    qa = read_json(scan.qa)
    assert (qa["verdict"], qa["decision"], qa["reasons"][0]["unit"]) == ("rejected", "keep", "px")
