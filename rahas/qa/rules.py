"""The rules of the two gates: metrics and limits in, findings out. Limits come from the parameters only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rahas.params import CaptureReviewParams, ResultReviewParams
from rahas.qa.findings import Finding, Findings, finding

Metrics = Mapping[str, Any]


def capture_findings(
    metrics: Metrics, *, timeline: Mapping[str, Any], damage: list[Any], role: str, params: CaptureReviewParams
) -> Findings:
    """First gate: what the capture shows."""
    broken = _damage(damage, timeline)
    reasons = [
        *broken.reasons,
        *_timeline(metrics, params),
        *_exposure(metrics, params),
        *_contrast(metrics, params),
        *([] if role == "calibration" else _object_span(metrics, params.min_object_span, after_cloud=False)),
        *_jitter(metrics, params),
    ]
    warnings = [*broken.warnings, *_unmeasured_jitter(metrics), *_lost_frames(metrics)]
    return Findings(reasons, warnings)


def result_findings(
    metrics: Metrics, *, told: list[Any], role: str, params: ResultReviewParams, capture_params: CaptureReviewParams
) -> Findings:
    """Second gate: what the result shows. ``told``: warnings of the stages before it, as sentences or findings."""
    reasons: list[Finding] = []
    if role != "calibration":
        reasons += _object_span(metrics, capture_params.min_object_span, after_cloud=True)
    share = metrics.get("measured_share")
    warnings = [one if isinstance(one, dict) else finding("surface", "surface", str(one)) for one in told]
    if share is not None and share < params.min_measured_share:
        reasons.append(
            finding(
                "coverage",
                "measured_share",
                f"Only {share:.0%} of the surface that the stripes reached could be measured (limit "
                f"{params.min_measured_share:.0%}): the stripes were lost on the way. Next time turn the lever more "
                "slowly, keep the rig still and shield the object from other light.",
                value=share,
                limit=params.min_measured_share,
                unit="share",
            )
        )
    differing = metrics.get("order_disagreement")
    if differing is not None and differing > params.reject_order_disagreement:
        message = (
            f"Following the stripes and reading the rotation disagree on {differing:.0%} of the surface: the stripes' "
            "numbers cannot be trusted. Next time turn the lever slowly and evenly, and keep the projector in focus."
        )
        limit = params.reject_order_disagreement
        reasons.append(finding("tracking", "order_disagreement", message, value=differing, limit=limit, unit="share"))
    ripple = metrics.get("ripple_after_rad")
    if ripple is not None and ripple > params.max_ripple_rad:
        warnings.append(
            finding(
                "banding",
                "ripple_after_rad",
                f"Waves along the stripes remain in the surface ({ripple:.3f} rad of phase). Next time crank more "
                "evenly and over more than one whole period.",
                value=ripple,
                limit=params.max_ripple_rad,
                unit="rad",
            )
        )
    return Findings(reasons, warnings + _compression(metrics, params) + _labels(metrics, params))


def _compression(metrics: Metrics, params: ResultReviewParams) -> list[Finding]:
    cost = metrics.get("compression_cost")
    if cost is None or cost <= params.max_compression_cost:
        return []
    message = (
        f"The film's compression carries errors on from frame to frame: the phase is {cost:.1f} times less certain "
        "than the frames' noise says, and depth noisier than it could be. Film at the camera's highest bit rate."
    )
    return [
        finding("compression", "compression_cost", message, value=cost, limit=params.max_compression_cost, unit="×")
    ]


def _labels(metrics: Metrics, params: ResultReviewParams) -> list[Finding]:
    """Warnings about the stripes' numbers: whether slide and lens were as in the calibration, and two ways agree."""
    warnings: list[Finding] = []
    moved = metrics.get("label_residual_stripes")
    finer = metrics.get("calibration_phase_offset_rad")
    if finer is None and moved is not None and moved > params.max_label_shift_stripes:
        warnings.append(
            finding(
                "calibration",
                "label_residual_stripes",
                f"In the first hold the stripes lie {moved:.2f} of a stripe beside where they lay in the calibration. "
                "If slide, focus or zoom were touched in between, depth is off: scan the target with each set-up.",
                value=moved,
                limit=params.max_label_shift_stripes,
                unit="stripe",
            )
        )
    differing = metrics.get("order_disagreement")
    if differing is not None and params.reject_order_disagreement >= differing > params.max_order_disagreement:
        warnings.append(
            finding(
                "tracking",
                "order_disagreement",
                f"Following the stripes and reading the rotation disagree on {differing:.1%} of the surface. Look for "
                "steps in the depth picture; next time turn the lever more slowly.",
                value=differing,
                limit=params.max_order_disagreement,
                unit="share",
            )
        )
    return warnings


def _timeline(metrics: Metrics, params: CaptureReviewParams) -> list[Finding]:
    for stage, act in (("rotation", "turn the lever from stop to stop"), ("scan", "turn the crank")):
        if not metrics.get(f"{stage}_frames"):
            message = f"The film shows no {stage}. Film the whole sequence: lamp on, wait, {act}, wait, lamp off."
            return [finding("timeline", f"{stage}_frames", message, value=0, limit=1, unit="frames")]
    periods = metrics.get("periods")
    if periods is not None and periods < params.min_periods:
        message = (
            f"The crank moved the stripes by {periods:.2f} periods; at least {params.min_periods:g} are needed to see "
            "every point in light and in dark. Next time crank on until each stripe has passed the place of the next."
        )
        return [finding("timeline", "periods", message, value=periods, limit=params.min_periods, unit="periods")]
    if metrics.get("object_span") is None:
        message = (
            "The stripes moved too little, or too unevenly, to be measured. Next time crank slowly and steadily over "
            "more than one whole period."
        )
        return [finding("timeline", "object_span", message, limit=params.min_periods, unit="periods")]
    return []


def _object_span(metrics: Metrics, limit: float, *, after_cloud: bool) -> list[Finding]:
    span = metrics.get("object_span")
    if span is None or span >= limit:
        return []
    if after_cloud:
        found = f"The connected surface in the middle of the image spans {span:.0%} of its width"
    else:
        found = f"Stripes can be measured over {span:.0%} of the image's width"
    message = (
        f"{found}; at least {limit:.0%} are asked for. Next time move the rig closer or fill the frame with the object"
        f"{'' if after_cloud else ', or give it more light if it is large but dark'}."
    )
    return [finding("object_span", "object_span", message, value=span, limit=limit, unit="of the width")]


def _jitter(metrics: Metrics, params: CaptureReviewParams) -> list[Finding]:
    jitter = metrics.get("jitter")
    if jitter is None or jitter <= params.max_jitter_px:
        return []
    message = (
        f"The rig was jarred: in the worst second the object shook by {jitter:.1f} pixels in the image (limit "
        f"{params.max_jitter_px:g}). Next time brace the stand, do not touch it while turning lever and crank, and "
        "scan again."
    )
    return [finding("jitter", "jitter", message, value=jitter, limit=params.max_jitter_px, unit="px")]


def _exposure(metrics: Metrics, params: CaptureReviewParams) -> list[Finding]:
    share = metrics.get("clipped_share")
    if share is None or share <= params.max_clipped_share:
        return []
    bright = metrics.get("clipped_high_share", share) >= metrics.get("clipped_low_share", 0.0)
    advice = (
        "close the lens's aperture or shorten the exposure" if bright else "open the aperture or bring the lamp nearer"
    )
    message = (
        f"{share:.0%} of the object is too {'bright' if bright else 'dark'} for the camera (limit "
        f"{params.max_clipped_share:.0%}): the stripes are cut off there. Next time {advice}."
    )
    return [finding("exposure", "clipped_share", message, value=share, limit=params.max_clipped_share, unit="share")]


def _contrast(metrics: Metrics, params: CaptureReviewParams) -> list[Finding]:
    contrast = metrics.get("contrast")
    if contrast is None or contrast >= params.min_contrast:
        return []
    message = (
        f"The stripes are only {contrast:.1f} times as strong as the camera's noise (limit {params.min_contrast:g}). "
        "Next time scan in the dark or in shade, focus the projector, open the aperture or bring the lamp nearer."
    )
    return [finding("contrast", "contrast", message, value=contrast, limit=params.min_contrast, unit="× noise")]


def _unmeasured_jitter(metrics: Metrics) -> list[Finding]:
    if metrics.get("object_span") is None or metrics.get("jitter") is not None:
        return []
    message = (
        "The object has too little texture to tell whether the rig stood still: look at the film yourself. A few "
        "chalk marks or a scale in the picture help."
    )
    return [finding("jitter", "jitter", message, unit="px")]


def _lost_frames(metrics: Metrics) -> list[Finding]:
    count = metrics.get("dropped_frames") or 0
    if not count:
        return []
    message = (
        f"The camera seems to have left out {count} frames; each frame is measured by itself, so the scan goes on."
    )
    return [finding("timeline", "dropped_frames", message, value=count, unit="frames")]


def _damage(damage: list[Any], timeline: Mapping[str, Any]) -> Findings:
    """Lost or broken frames reject where they lie in rotation or scan; elsewhere, or with no known place, they warn."""
    reasons: list[Finding] = []
    warnings: list[Finding] = []
    for one in damage:
        entry = one if isinstance(one, dict) else {"message": str(one)}
        first = entry.get("frame")
        last = entry.get("last_frame") if entry.get("last_frame") is not None else first
        stage = None if first is None else _moving_stage(timeline, int(first), int(last if last is not None else first))
        place = "at an unknown place" if first is None else f"at frame {first}"
        broken = None if first is None else int(last if last is not None else first) - int(first) + 1
        text = f"The video is damaged {place}: {entry.get('message', '')}".rstrip(" :.") + "."
        if stage is None:
            warnings.append(finding("damaged", "damaged_frames", text, value=broken, unit="frame"))
        else:
            text += f" This is during the {stage}. Copy the file from the camera's card again, or scan again."
            reasons.append(finding("damaged", "damaged_frames", text, value=broken, unit="frame"))
    return Findings(reasons[:3], warnings[:5])


def _moving_stage(timeline: Mapping[str, Any], first: int, last: int) -> str | None:
    for run in timeline["intervals"]:
        if run["stage"] in ("rotation", "scan") and first <= run["last"] and last >= run["first"]:
            return str(run["stage"])
    return None
