"""Rules on whether the rig is still as it was calibrated: what probably happened, what it costs, what to do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rahas.params import ResultReviewParams
from rahas.qa.findings import Findings, finding

_METRIC = "calibration_phase_offset_rad"
LIKELY, SURE = (
    5.0,
    10.0,
)  # standard deviations, for a warning and for a rejection: compressed films stay below the second
_CAUSES = {
    "slide_shift": "the slide sits otherwise in its holder than at the calibration (by {size:.2f} rad of its pattern)",
    "projector_yaw": "the projector was turned sideways against the camera (by {size:.2f}°), or the slide's "
    "mount moved",
    "projector_pitch": "the projector was turned up or down against the camera (by {size:.2f}°)",
    "projector_roll": "slide or projector was turned about the optical axis (by {size:.2f}°), or the lever was not at "
    "its first stop",
    "projector_zoom": "zoom or focus of the projector was changed (its picture's size by {size:.1%})",
    "camera_zoom": "zoom or focus of the camera was changed (its picture's size by {size:.1%})",
}


def consistency_metrics(consistency: Mapping[str, Any] | None) -> dict[str, float | None]:
    """The figures of a scan's comparison with its calibration; null where it could not be made."""
    found = consistency or {}
    return {
        _METRIC: found.get("offset_rad"),
        "calibration_phase_gradient_rad": found.get("gradient_rad"),
        "calibration_depth_error_mm": found.get("depth_mm"),
    }


def consistency_findings(consistency: Mapping[str, Any] | None, params: ResultReviewParams) -> Findings:
    """Warn where the first hold's pattern is not where the calibration says; reject where depth suffers beyond use."""
    if consistency is None:
        message = (
            "Whether slide, lenses and rig are as at the calibration could not be checked: the first hold of the scan "
            "or of its calibration cannot be used. Next time keep lever and crank still for a second once the lamp is "
            "on."
        )
        return Findings([], [finding("calibration", _METRIC, message, unit="rad")])
    offset, gradient = float(consistency["offset_rad"]), float(consistency["gradient_rad"])
    added, certainty = float(consistency["scan_phase_rad"]), _certainty(consistency)
    if added > params.max_rig_change_rad and certainty >= SURE and not _may_be_the_lever(consistency):
        text = f"{_lies(offset, gradient)}{_explained(consistency)} Scan the target and the object again."
        worst = finding(
            "calibration", "scan_phase_rad", text, value=round(added, 4), limit=params.max_rig_change_rad, unit="rad"
        )
        return Findings([worst], [])
    seen = {
        _METRIC: abs(offset) * (abs(offset) > LIKELY * float(consistency["offset_std_rad"])),
        "calibration_phase_gradient_rad": gradient * (gradient > LIKELY * float(consistency["gradient_std_rad"])),
        "scan_phase_rad": added * (certainty >= LIKELY),
    }
    metric = max(seen, key=lambda name: seen[name])
    if seen[metric] <= params.rig_change_warning_rad:
        return Findings([], [])
    advice = " If so, scan the target again with this set-up."
    if added > params.max_rig_change_rad and certainty < SURE:
        advice = " The calibration is too noisy to be sure: scan the target again, with less compression of the film."
    text = f"{_lies(offset, gradient)}{_explained(consistency)}{advice}"
    value, limit = round(seen[metric], 4), params.rig_change_warning_rad
    return Findings([], [finding("calibration", metric, text, value=value, limit=limit, unit="rad")])


def _certainty(consistency: Mapping[str, Any]) -> float:
    """The depth error in standard deviations."""
    std = float(consistency["depth_std_mm"])
    return float(consistency["depth_mm"]) / std if std > 0 else float("inf")


def _may_be_the_lever(consistency: Mapping[str, Any]) -> bool:
    """Whether a lever that was not at its first stop looks like that: it shifts no depth."""
    return float(consistency["changes"]["projector_roll"]) != 0.0


def _lies(offset: float, gradient: float) -> str:
    return (
        f"In the first hold the pattern lies {abs(offset):.3f} rad (mean) and {gradient:.3f} rad (varying over the "
        "field) beside where the calibration puts it"
    )


def _explained(consistency: Mapping[str, Any]) -> str:
    cause = str(consistency["cause"])
    if cause not in _CAUSES:
        return "."
    size = abs(float(consistency["changes"][cause]))
    return (
        f": most likely {_CAUSES[cause].format(size=size)}. Depth is then off by about "
        f"{float(consistency['depth_mm']):.2g} mm (rms)."
    )
