"""Calibration and surface in numbers: residuals mark by mark, what the models and the debanding report."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

from rahas.report.words import metric_label, metric_unit, number, value_text

_COLUMNS = (
    ("mark", "mark", "d"),
    ("x_px", "x, px", ".2f"),
    ("y_px", "y, px", ".2f"),
    ("unwrapped_phase", "unwrapped phase, rad", ".3f"),
    ("residual_x_px", "residual x, px", "+.3f"),
    ("residual_y_px", "residual y, px", "+.3f"),
)


def residual_rows(calibration: Mapping[str, Any] | None) -> list[dict[str, str]]:
    """One row a mark, ready to print: heading → text; empty without a calibration."""
    marks = (calibration or {}).get("marks") or []
    return [{heading: _column_text(mark.get(name), form) for name, heading, form in _COLUMNS} for mark in marks]


def _column_text(value: Any, form: str) -> str:
    return "—" if value is None else format(value, form).replace("-", "−")


def model_facts(calibration: Mapping[str, Any] | None, *, told: Collection[str] = ()) -> list[tuple[str, str]]:
    """Summary residuals, less those ``told`` among the metrics, and lens terms as (name, value with unit)."""
    if not calibration:
        return []
    residuals = calibration.get("residuals") or {}
    facts = [
        (metric_label(name), value_text(value, metric_unit(name)))
        for name, value in residuals.items()
        if name not in told and (value is None or isinstance(value, int | float | str))
    ]
    camera = calibration.get("camera") or {}
    if "width_px" in camera and "height_px" in camera:
        facts.append(("camera", f"{camera['width_px']} × {camera['height_px']} px"))
    std = calibration.get("standard_deviations") or {}
    if "radial" in camera and "centre_px" in camera:
        corner = 100.0 * sum(float(c) ** 2 for c in camera["centre_px"])  # per cent a unit of k1
        share = _with_std(corner * camera["radial"], corner * std.get("camera_radial", 0.0))
        facts.append(("camera's distortion at the image's corner", f"{share} %"))
    projector = calibration.get("projector") or {}
    if "radial" in projector:
        share = _with_std(projector["radial"], std.get("projector_radial", 0.0))
        facts.append(("projector's distortion k1, of squared tangents off its axis", share))
    facts.append(("texture camera", "modelled" if calibration.get("texture_camera") else "none"))
    return facts


def _with_std(value: float, std: float) -> str:
    """A value and, where it was fitted, its standard deviation."""
    return f"{number(value, span=std)} ± {number(std, span=std)}" if std else number(value)


def surface_facts(attributes: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What cloud.zarr's attributes tell: share measured, ripple by order before and after debanding."""
    facts = []
    if attributes.get("measured_share") is not None:
        facts.append(
            ("pixels with phase that are points of the cloud", f"{100 * float(attributes['measured_share']):.1f} %")
        )
    for name, label in (("ripple_before_rad", "before"), ("ripple_after_rad", "after")):
        if attributes.get(name):
            orders = ", ".join(f"{1000 * float(value):.1f}" for value in attributes[name])
            facts.append((f"ripple {label} debanding, orders 1 to {len(attributes[name])}", f"{orders} mrad"))
    return facts


def side_remarks(evidence_warnings: list[Any], qa: Mapping[str, Any]) -> list[str]:
    """Remarks of calibration and cloud that the verdict file does not repeat, each once."""
    told = {str(warning.get("message", "")) for warning in qa.get("warnings", [])}
    remarks = (
        str(remark.get("message", "")) if isinstance(remark, Mapping) else str(remark) for remark in evidence_warnings
    )
    return [remark for remark in dict.fromkeys(remarks) if remark and remark not in told]


def displacement_series(review: Mapping[str, Any] | None) -> list[float | None]:
    """Length of the object's displacement per frame, px; empty where the review keeps none."""
    review = review or {}
    series = (review.get("series") or {}).get("displacement_px") or review.get("displacement_px") or []
    return [math.hypot(*value) if isinstance(value, list) and None not in value else _number(value) for value in series]


def _number(value: Any) -> float | None:
    return abs(float(value)) if isinstance(value, int | float) else None
