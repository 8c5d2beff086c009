"""First QA gate: what the capture shows, before any phase is computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rahas.kernels.exposure import clipped_from_samples, sensor_limits
from rahas.kernels.modulation import StripeFit, StripeFitter, pitch_from_fit
from rahas.kernels.object_span import measurable_from_modulation, span_from_region
from rahas.params import CaptureReviewParams
from rahas.stages.capture_noise import capture_noise
from rahas.stages.moments import Moments
from rahas.stages.object_motion import ObjectMotion, object_motion
from rahas.stages.timeline_spans import Span, stage_frames
from rahas.typing import BoolArray, FloatArray, FrameStack

_WORKING_WIDTH = 360
_LARGEST_FACTOR = 4
_LEAST_PITCH = 10.0
_SAMPLES = 20
_LIT_SHARE, _LIT_PERCENTILE, _LEAST_REGION = 0.25, 98, 200


class CaptureReview(NamedTuple):
    """What the first gate measured."""

    metrics: dict[str, Any]
    """By name; ``None`` where the capture did not allow to measure it."""
    displacement: FloatArray
    """(frame, 2) px, NaN where unknown."""


def review_capture(
    frames: FrameStack,
    *,
    time_s: FloatArray,
    attributes: Mapping[str, Any],
    timeline: Mapping[str, Any],
    params: CaptureReviewParams,
) -> CaptureReview:
    """Measure object span, jitter, exposure and contrast of a capture.

    Parameters
    ----------
    frames
        (frame, y, x), luma as shot.
    time_s
        (frame,).
    attributes
        Of frames.zarr: ``bit_depth``, ``interlaced``, ``field_order``, ``luma_range``.
    timeline
        The content of timeline.json.
    """
    rotation, scan = stage_frames(timeline, "rotation"), stage_frames(timeline, "scan")
    steps = np.array([np.nan if v is None else v for v in timeline.get("phase_step_rad") or []], dtype=np.float64)
    metrics = timeline_metrics(timeline)
    unknown = np.full((len(time_s), 2), np.nan)
    if scan is None or len(steps) <= scan.last:
        return CaptureReview(metrics, unknown)
    moments, fit = _stripe_fit(frames, attributes, scan, steps)
    if fit is None:
        return CaptureReview(metrics, unknown)
    bit_depth = int(attributes.get("bit_depth", 8))
    sigma = capture_noise(moments, fit, timeline, steps, top_level=2.0**bit_depth - 1).at(fit.background)
    region = measurable_from_modulation(modulation=fit.modulation, noise_sigma=sigma)
    metrics |= _light_metrics(moments, fit, sigma, region, attributes, scan, params)
    if rotation is None or not region.any():
        return CaptureReview(metrics | {"jitter": None}, unknown)
    motion = object_motion(
        moments,
        fit,
        sigma,
        time_s=time_s,
        first=rotation.first,
        last=scan.last,
        scan=scan,
        black_level=16.0 * 2.0 ** (bit_depth - 8) if attributes.get("luma_range") == "limited" else 0.0,
        largest_std=params.max_jitter_std_px,
    )
    return CaptureReview(metrics | _motion_metrics(motion), motion.displacement)


def timeline_metrics(timeline: Mapping[str, Any]) -> dict[str, Any]:
    """What the timeline alone tells."""
    metrics: dict[str, Any] = {"frames": timeline.get("frames"), "periods": timeline.get("periods")}
    for stage in ("rotation", "scan"):
        run = stage_frames(timeline, stage)
        metrics[f"{stage}_frames"] = 0 if run is None else run.last - run.first + 1
    metrics["duplicated_frames"] = len(timeline.get("duplicates") or [])
    metrics["dropped_frames"] = sum(int(gap["count"]) for gap in timeline.get("dropped") or [])
    return metrics


def _stripe_fit(
    frames: FrameStack, attributes: Mapping[str, Any], scan: Span, steps: FloatArray
) -> tuple[Moments, StripeFit | None]:
    """The scan's background and modulation, on a grid as coarse as speed wants and the stripe pitch allows."""
    factor = int(np.clip(round(frames.shape[2] / _WORKING_WIDTH), 1, _LARGEST_FACTOR))
    while True:
        moments = Moments(
            frames,
            interlaced=bool(attributes.get("interlaced", False)),
            top_first=attributes.get("field_order") != "bottom_first",
            factor=factor,
        )
        used = np.flatnonzero(np.isfinite(steps[scan.first : scan.last + 1])) + scan.first
        fitter = StripeFitter(steps[used])
        for first, block in moments.blocks(scan.first, scan.last):
            known = np.isfinite(steps[first : first + len(block)])
            if known.any():
                fitter.add(block[known], steps[first : first + len(block)][known])
        fit = fitter.solve()
        if fit is None or factor == 1 or pitch_from_fit(fit) >= _LEAST_PITCH:
            return moments, fit
        factor = max(1, factor // 2)


def _light_metrics(
    moments: Moments,
    fit: StripeFit,
    sigma: FloatArray,
    region: BoolArray,
    attributes: Mapping[str, Any],
    scan: Span,
    params: CaptureReviewParams,
) -> dict[str, Any]:
    bit_depth = int(attributes.get("bit_depth", 8))
    picked = np.unique(np.linspace(scan.first, scan.last, _SAMPLES).astype(int))
    samples = moments.samples([int(n) for n in picked])
    limits = sensor_limits(samples, bit_depth=bit_depth, luma_range=str(attributes.get("luma_range", "unknown")))
    clipped = clipped_from_samples(samples, limits, bit_depth=bit_depth)
    whole = region | clipped.high
    span = span_from_region(region)
    # Where no object is wide enough, all that is lit is looked at, to tell a weak pattern from a small object.
    seen = region if region.any() and span >= params.min_object_span else region | _lit(fit, region, limits.bottom)
    return {
        "object_span": span,
        "measurable_share": float(region.mean()),
        "contrast": float(np.median((fit.modulation / sigma)[seen])),
        "clipped_share": float(((clipped.high | clipped.low) & whole).sum() / max(whole.sum(), 1)),
        "clipped_high_share": float((clipped.high & whole).sum() / max(whole.sum(), 1)),
        "clipped_low_share": float((clipped.low & whole).sum() / max(whole.sum(), 1)),
        "noise_grey_levels": float(np.median(sigma[seen])),
        "pitch_px": pitch_from_fit(fit) * moments.factor if np.isfinite(pitch_from_fit(fit)) else None,
    }


def _lit(fit: StripeFit, region: BoolArray, black_level: float) -> BoolArray:
    """What is about as bright as the measurable region, or, without one, as the brightest of the image."""
    light = fit.background - black_level
    reference = np.median(light[region]) if region.sum() >= _LEAST_REGION else np.percentile(light, _LIT_PERCENTILE)
    return np.asarray(light >= _LIT_SHARE * reference)


def _motion_metrics(motion: ObjectMotion) -> dict[str, Any]:
    return {"jitter": motion.jitter, "jitter_std_px": motion.std, "object_found_share": motion.found_share}
