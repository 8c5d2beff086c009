"""The two QA gates and the verdict: review/capture.json, review/result.json, qa.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from rahas.params import CaptureReviewParams, ResultReviewParams
from rahas.qa.consistency import consistency_findings, consistency_metrics
from rahas.qa.findings import Findings
from rahas.qa.rules import capture_findings, result_findings
from rahas.qa.verdict import verdict
from rahas.stages.review_capture import review_capture
from rahas.stages.review_result import review_result
from rahas.stores.arrays import open_store
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder


def run_capture(scan: ScanFolder, *, role: str, params: CaptureReviewParams) -> None:
    """First gate: frames.zarr and timeline.json → review/capture.json."""
    cv2.setNumThreads(1)
    store, timeline = open_store(scan.frames), read_json(scan.timeline)
    attributes = dict(store.attrs)
    review = review_capture(
        store["frames"], time_s=store["time_s"][...], attributes=attributes, timeline=timeline, params=params
    )
    damage: Any = attributes.get("damage") or []
    metrics = review.metrics | {"damaged_frames": _damaged_frames(damage)}
    found = capture_findings(metrics, timeline=timeline, damage=list(damage), role=role, params=params)
    known = np.isfinite(review.displacement).all(axis=1)
    series = [
        [round(float(x), 3), round(float(y), 3)] if k else None
        for (x, y), k in zip(review.displacement, known, strict=True)
    ]
    write_json(scan.capture_review, {"metrics": metrics, **found._asdict(), "series": {"displacement_px": series}})


def run_result(scan: ScanFolder, *, role: str, params: ResultReviewParams, capture_params: CaptureReviewParams) -> None:
    """Second gate: cloud.zarr, phase.zarr (and what the first gate measured) → review/result.json."""
    cv2.setNumThreads(1)
    cloud = open_store(scan.cloud)
    before = _read(scan.capture_review) or {"metrics": {}}
    metrics = review_result(
        cloud["xyz"][...], measurable_share=before["metrics"].get("measurable_share"), params=params
    )
    attributes: dict[str, Any] = dict(cloud.attrs)
    for name in ("ripple_before_rad", "ripple_after_rad"):
        values = [float(v) for v in np.ravel(attributes.get(name, [])) if np.isfinite(v)]
        metrics[name] = max(values, default=None)
    solved = open_store(scan.phase).attrs
    metrics["label_residual_stripes"] = solved.get("label_anchor_residual_stripes")
    metrics["order_disagreement"] = solved.get("rotation_code_disagreement")
    metrics["compression_cost"] = solved.get("compression_cost")
    consistency: Any = attributes.get("calibration_consistency")
    metrics |= consistency_metrics(consistency)
    changed = consistency_findings(consistency, params)
    found = result_findings(
        metrics, told=list(attributes.get("warnings") or []), role=role, params=params, capture_params=capture_params
    )
    found = Findings(found.reasons + changed.reasons, found.warnings + changed.warnings)
    write_json(scan.result_review, {"metrics": metrics, **found._asdict()})


def write_verdict(
    scan: ScanFolder,
    *,
    decision: str,
    role: str,
    processed: bool,
    overridden: bool,
    problem: Mapping[str, Any] | None,
) -> None:
    """qa.json from what the gates, the log and, where one could not go on, a stage (``problem``) say.

    Review files of an earlier run, beyond where this one stopped, do not count.
    """
    capture, result = _read(scan.capture_review), _read(scan.result_review)
    if problem is not None and not (scan.frames.exists() and scan.timeline.exists()):
        capture = None
    if problem is not None or capture is None or (capture["reasons"] and not overridden):
        result = None
    content = verdict(
        scan.scan_id,
        decision=decision,
        processed=processed,
        overridden=overridden,
        capture=capture,
        result=result,
        problem=problem,
    )
    if role == "calibration" and scan.calibration.exists():
        content["metrics"] |= read_json(scan.calibration)["residuals"]
    write_json(scan.qa, content)


def _damaged_frames(damage: list[Any]) -> int:
    spans = [(d["frame"], d.get("last_frame")) for d in damage if isinstance(d, dict) and d.get("frame") is not None]
    return len({n for first, last in spans for n in range(first, (first if last is None else last) + 1)})


def _read(path: Path) -> dict[str, Any] | None:
    return read_json(path) if path.exists() else None
