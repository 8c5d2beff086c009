"""What a page says when the rig is not as it was calibrated."""

from __future__ import annotations

from typing import Any

import pytest

from rahas.kernels.rig_change import CHANGES
from rahas.params import CaptureReviewParams, ResultReviewParams
from rahas.qa.consistency import consistency_findings, consistency_metrics
from rahas.qa.rules import result_findings

SOUND: dict[str, Any] = {
    "offset_rad": 0.002, "offset_std_rad": 0.0005, "gradient_rad": 0.003, "gradient_std_rad": 0.002,
    "scan_phase_rad": 0.0, "depth_mm": 0.0, "depth_std_mm": 0.0, "cause": "",
    "changes": dict.fromkeys(CHANGES, 0.0),
}  # fmt: skip


def changed(cause: str, size: float, **figures: float) -> dict[str, Any]:
    return {**SOUND, **figures, "cause": cause, "changes": {**SOUND["changes"], cause: size}}


def test_a_sound_pair_says_nothing() -> None:
    assert consistency_findings(SOUND, ResultReviewParams()) == ([], [])
    assert consistency_metrics(SOUND)["calibration_phase_offset_rad"] == 0.002


@pytest.mark.parametrize(
    ("consistency", "words"),
    [
        (changed("slide_shift", 0.1, offset_rad=0.1, scan_phase_rad=0.1, depth_mm=0.7), ["0.100 rad", "holder"]),
        (changed("camera_zoom", -0.005, gradient_rad=0.11, scan_phase_rad=0.07, depth_mm=0.9), ["zoom", "0.5%"]),
        (changed("projector_roll", -0.3, gradient_rad=0.07, depth_mm=1.5), ["optical axis", "0.30°"]),
        (changed("projector_pitch", 0.1, gradient_rad=0.013, scan_phase_rad=0.3, depth_mm=4.0), ["up or down", "4 mm"]),
        (changed("projector_yaw", 0.1, offset_rad=-0.29), ["sideways", "0.290 rad"]),
    ],
)  # fmt: skip
def test_a_change_is_named_with_its_size_and_cost(consistency: dict[str, Any], words: list[str]) -> None:
    reasons, warnings = consistency_findings(consistency, ResultReviewParams())
    assert reasons == []
    assert [one["rule"] for one in warnings] == ["calibration"]
    assert warnings[0]["value"] > warnings[0]["limit"]
    for word in words:
        assert word in warnings[0]["message"]
    assert warnings[0]["message"].endswith("set-up.")


def test_a_change_beyond_use_rejects() -> None:
    reasons, warnings = consistency_findings(
        changed("slide_shift", 0.9, offset_rad=0.9, scan_phase_rad=0.9, depth_mm=6.3), ResultReviewParams()
    )
    assert warnings == []
    assert reasons[0]["rule"] == "calibration"
    assert reasons[0]["value"] == 0.9
    at_limit = changed("slide_shift", 0.6, offset_rad=0.6, scan_phase_rad=0.6, depth_mm=4.2)
    assert consistency_findings(at_limit, ResultReviewParams()).reasons == []


def test_what_cannot_be_checked_is_said() -> None:
    reasons, warnings = consistency_findings(None, ResultReviewParams())
    assert (reasons, len(warnings)) == ([], 1)
    assert set(consistency_metrics(None).values()) == {None}


@pytest.mark.parametrize(("finer", "count"), [(None, 1), (0.7, 0)])
def test_the_coarse_warning_gives_way_to_the_fine_one(finer: float | None, count: int) -> None:
    found = result_findings(
        {"object_span": 0.8, "label_residual_stripes": 0.11, "calibration_phase_offset_rad": finer},
        told=[], role="scan", params=ResultReviewParams(), capture_params=CaptureReviewParams(),
    )  # fmt: skip
    assert len(found.warnings) == count
