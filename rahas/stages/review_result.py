"""Second QA gate: what the result shows, after the cloud."""

from __future__ import annotations

from typing import Any

import numpy as np

from rahas.kernels.object_span import span_from_region, surface_at_centre
from rahas.kernels.resolution import image_scale
from rahas.params import ResultReviewParams
from rahas.typing import AnyArray, BoolArray


def review_result(points: AnyArray, *, measurable_share: float | None, params: ResultReviewParams) -> dict[str, Any]:
    """Metrics of a cloud.

    Parameters
    ----------
    points
        (y, x, 3) mm in the target's frame, NaN where nothing was measured.
    measurable_share
        Share of the image in which the capture's stripes could be measured; ``None`` where it is not known.
    """
    measured: BoolArray = np.asarray(np.isfinite(points).all(axis=-1))
    depth = np.where(measured, points[..., 2], np.nan)
    step = params.depth_step_spacings * _point_spacing(points)
    bridged = round(params.bridged_px * image_scale(*measured.shape))
    surface = surface_at_centre(depth, largest_step=step, bridged=bridged) if measured.any() else measured
    share = None
    if measurable_share:
        share = min(float(measured.mean()) / measurable_share, 1.0)
    return {
        "object_span": span_from_region(surface),
        "measured_share": share,
        "points": int(measured.sum()),
        "point_spacing_mm": step / params.depth_step_spacings if measured.any() else None,
    }


def _point_spacing(points: AnyArray) -> float:
    """Median distance of horizontal neighbours across the line of sight (x, y), mm; 0 where there are none."""
    across = np.hypot(np.diff(points[..., 0], axis=1), np.diff(points[..., 1], axis=1))
    known = across[np.isfinite(across)]
    return float(np.median(known)) if len(known) else 0.0
