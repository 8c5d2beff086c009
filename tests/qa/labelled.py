"""Labelled captures: rendered small and short, brought through timeline and first gate to a verdict."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.jitter import jitter_from_displacement
from rahas.params import CaptureReviewParams, TimelineParams
from rahas.qa.rules import capture_findings
from rahas.simulate.capture import Rendering, render
from rahas.simulate.specs import CaptureSpec
from rahas.stages.review_capture import review_capture
from rahas.stages.timeline import find_timeline
from rahas.typing import AnyArray

ATTRIBUTES = {"bit_depth": 8, "interlaced": False, "field_order": "progressive", "luma_range": "limited"}


class Judged(NamedTuple):
    """What the first gate says of a rendered capture, beside the truth."""

    rules: list[str]
    """Rules that reject it; empty: accepted."""
    warned: list[str]
    metrics: dict[str, Any]
    true_jitter: float | None
    """px, by the contract's definition."""


def judge(capture: CaptureSpec) -> Judged:
    """Render a capture and review it as the workflow would."""
    rendering = render(capture)
    time_s = np.arange(len(rendering.frames)) / capture.camera.frame_rate
    try:
        timeline = timeline_of(rendering.frames, time_s, capture.camera.frame_rate)
    except CaptureProblem as problem:
        return Judged([problem.rule], [], {}, None)
    params = CaptureReviewParams()
    review = review_capture(rendering.frames, time_s=time_s, attributes=ATTRIBUTES, timeline=timeline, params=params)
    found = capture_findings(review.metrics, timeline=timeline, damage=[], role="scan", params=params)
    return Judged(
        [reason["rule"] for reason in found.reasons],
        [warning["rule"] for warning in found.warnings],
        review.metrics,
        true_jitter(rendering, time_s),
    )


def timeline_of(frames: AnyArray, time_s: AnyArray, frame_rate: float) -> dict[str, Any]:
    """The content of timeline.json for frames (frame, y, x) uint8."""
    height, width = frames.shape[1] // 4, frames.shape[2] // 4
    small = [cv2.resize(frame.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA) for frame in frames]
    change = np.r_[0.0, np.abs(np.diff(frames.astype(np.int16), axis=0)).mean(axis=(1, 2))]
    found = find_timeline(
        np.round(np.stack(small) * 64).astype(np.uint16),
        time_s=time_s,
        change=change,
        frame_rate=frame_rate,
        params=TimelineParams(),
    )
    return {
        "frames": len(frames),
        "intervals": [interval._asdict() for interval in found.intervals],
        "duplicates": found.duplicates,
        "dropped": [gap._asdict() for gap in found.dropped],
        "phase_step_rad": [None if np.isnan(step) else float(step) for step in found.phase_step_rad],
        "periods": found.periods,
    }


def true_jitter(rendering: Rendering, time_s: AnyArray) -> float | None:
    """Jitter of the true displacement, from the start of the rotation to the end of the scan."""
    truth = rendering.truth
    stages = dict(zip(truth["interval_stage"].tolist(), range(len(truth["interval_stage"])), strict=True))
    if "rotation" not in stages or "scan" not in stages:
        return None
    moving = slice(int(truth["interval_first"][stages["rotation"]]), int(truth["interval_last"][stages["scan"]]) + 1)
    return jitter_from_displacement(truth["jitter"][moving], time_s[moving])
