"""No wrong verdict on a set of rendered captures whose label follows from how they were made."""

from __future__ import annotations

from typing import Any

import pytest

from rahas.simulate.examples import example
from rahas.simulate.specs import CaptureSpec

from .labelled import judge


def bumped(at_s: float, peak_px: float, **rest: Any) -> dict[str, Any]:
    """A hand that knocks the rig once."""
    return {"bumps": ({"at_s": at_s, "peak_px": peak_px, **rest},)}


IN_ROTATION_S, IN_SCAN_S = 1.5, 4.0
WIDTH_MM = 297.0
"""Of the short example's view, at the object."""

ACCEPTED = {
    "tricircle": example("tricircle", short=True),
    "monkey, gamma": example("monkey", short=True, seed=2, camera={"gamma": 1.8}),
    "circle, flicker": example("circle", short=True, seed=3, camera={"flicker": 0.02}),
    "sphere": example("sphere", short=True),
    "steps": example("steps", short=True, seed=4),
    "grinding stone over 0.6": example("metate", short=True, scene={"size_mm": 0.62 * WIDTH_MM}),
    "grinding stone over 0.8": example("metate", short=True, seed=5, scene={"size_mm": 0.8 * WIDTH_MM}),
    "1.0 period": example("circle", short=True, seed=6, hand={"periods": 1.05}),
    "2.3 periods": example("tricircle", short=True, seed=7, hand={"periods": 2.3}),
    "knock of 0.3 px in the rotation": example("tricircle", short=True, hand=bumped(IN_ROTATION_S, 0.75)),
    "knock of 0.7 px in the rotation": example("monkey", short=True, hand=bumped(IN_ROTATION_S, 1.7)),
    "knock of 0.6 px in the scan": example("circle", short=True, hand=bumped(IN_SCAN_S, 1.5, direction_deg=60.0)),
    "smooth white plane": example("plane", short=True, scene={"texture": 0.0, "relief": 0.0}),
}


def stone(share: float, seed: int) -> CaptureSpec:
    """A grinding stone that spans a share of the image's width."""
    return example("metate", short=True, seed=seed, scene={"size_mm": share * WIDTH_MM})


DIM = {"peak": 0.03, "read_noise": 0.012, "shot_noise": 1e-3}
REJECTED = {
    "grinding stone over 0.2": ("object_span", stone(0.2, 1)),
    "grinding stone over 0.3": ("object_span", stone(0.3, 8)),
    "grinding stone over 0.43": ("object_span", stone(0.43, 9)),
    "knock of 1.5 px in the rotation": ("jitter", example("tricircle", short=True, hand=bumped(IN_ROTATION_S, 3.7))),
    "knock of 4 px in the rotation": ("jitter", example("circle", short=True, hand=bumped(IN_ROTATION_S, 10.0))),
    "knock of 1.5 px in the scan": (
        "jitter",
        example("monkey", short=True, hand=bumped(IN_SCAN_S, 3.7, direction_deg=30.0)),
    ),
    "quick knock of 3 px in the scan": (
        "jitter",
        example("circle", short=True, hand=bumped(IN_SCAN_S, 7.0, frequency_hz=6.0)),
    ),
    "downward knock in the scan": (
        "jitter",
        example("tricircle", short=True, hand=bumped(IN_SCAN_S, 4.5, direction_deg=90.0)),
    ),
    "0.7 period": ("timeline", example("tricircle", short=True, hand={"periods": 0.7})),
    "crank not turned": ("timeline", example("circle", short=True, hand={"periods": 0.0})),
    "lever not turned": ("timeline", example("circle", short=True, hand={"rotation_s": 0.0})),
    "overexposed": ("exposure", example("tricircle", short=True, camera={"peak": 2.5})),
    "dim lamp in noise": ("contrast", example("monkey", short=True, camera=DIM)),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_good_captures_are_accepted(name: str) -> None:
    judged = judge(ACCEPTED[name])
    assert judged.rules == []
    if judged.metrics["jitter"] is not None:
        assert judged.metrics["jitter"] == pytest.approx(judged.true_jitter, rel=0.10, abs=0.15)


@pytest.mark.parametrize("name", REJECTED)
def test_spoilt_captures_are_rejected_for_their_cause(name: str) -> None:
    rule, capture = REJECTED[name]
    judged = judge(capture)
    assert judged.rules[0] == rule
    assert set(judged.rules) <= {rule, "object_span"}
    if rule == "jitter":
        assert judged.metrics["jitter"] == pytest.approx(judged.true_jitter, rel=0.10, abs=0.05)
