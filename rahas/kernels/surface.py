"""Cleaning of an organised grid of points, and its normals."""

from __future__ import annotations

import cv2
import numpy as np

from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray

_BAND_PIXELS = 1 << 16
"""A pixel takes some hundred bytes on the way to its normal."""


def surface_mask(
    distance: FloatArray,
    *,
    pixel_angle: float,
    distance_std: FloatArray,
    max_slope_deg: float,
    min_piece_px: int,
) -> BoolArray:
    """Points (y, x) of surfaces: no spikes, no mixed pixels at depth steps, no small loose pieces.

    ``distance`` (y, x) mm from the camera, NaN where not measured; ``pixel_angle`` rad between neighbouring rays;
    ``distance_std`` (y, x) mm. Between neighbours more depth than a slope of ``max_slope_deg`` (and four standard
    deviations) is a step: the pixels on both sides of it may mix two depths, and are left out.
    """
    depth = distance.astype(np.float32)
    measured = np.isfinite(depth)
    noise = np.where(np.isfinite(distance_std), distance_std, np.float32(0.0)).astype(np.float32, copy=False)
    allowed = np.where(measured, depth, np.float32(0.0))
    allowed *= np.float32(pixel_angle * np.tan(np.deg2rad(max_slope_deg)))
    noise *= np.float32(4.0 * np.sqrt(2.0))
    allowed += noise
    del noise
    filled = np.where(measured, depth, local_mean(depth[..., None], radius=2)[..., 0])
    filled = np.nan_to_num(filled, copy=False, nan=0.0)
    kept = measured & (np.abs(depth - cv2.medianBlur(filled, 5)) < 2.0 * allowed)
    del filled
    step = np.zeros(depth.shape, dtype=np.bool_)
    for axis in (0, 1):
        before, after = _halves(axis)
        both = kept[before] & kept[after]
        jump = both & (np.abs(depth[after] - depth[before]) > np.maximum(allowed[after], allowed[before]))
        step[before] |= jump
        step[after] |= jump
    kept &= ~step
    del step, allowed, depth
    _, labels, stats, _ = cv2.connectedComponentsWithStats(kept.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= min_piece_px
    large[0] = False
    mask: BoolArray = large[labels]
    return mask


def normals_of_grid(points: AnyArray, toward: FloatArray, *, radius: int = 2) -> Float32Array:
    """Unit normals (y, x, 3) of organised ``points`` (y, x, 3), on the side of ``toward`` (3,); NaN where no point is.

    Points are averaged over (2·radius + 1)² pixels first. A point without neighbours looks at ``toward``.
    """
    height, width = points.shape[:2]
    normals = np.empty(points.shape, np.float32)
    size, margin = max(1, _BAND_PIXELS // width), radius + 1
    for first in range(0, height, size):
        above, stop = max(0, first - margin), min(first + size, height)
        band = np.asarray(points[above : stop + margin], dtype=np.float64)
        normals[first:stop] = _normals(band, toward, radius)[first - above : stop - above]
    return normals


def _normals(points: FloatArray, toward: FloatArray, radius: int) -> FloatArray:
    measured = np.isfinite(points[..., 0])
    smooth = local_mean(points, radius=radius)
    across, down = _difference(smooth, 1), _difference(smooth, 0)
    normal = np.cross(across, down)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    sight = toward - points
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    known = np.isfinite(length) & (length > 1e-12)
    normal = np.where(known, normal / np.where(known, length, 1.0), sight)
    facing = np.sum(normal * sight, axis=-1, keepdims=True)
    oriented: FloatArray = np.where(measured[..., None], np.where(facing < 0, -normal, normal), np.nan)
    return oriented


def local_mean(values: FloatArray, *, radius: int) -> FloatArray:
    """Mean (y, x, n) over a square window of what is measured in it; NaN where nothing is. The dtype stays."""
    measured = np.isfinite(values[..., 0])
    side = (2 * radius + 1, 2 * radius + 1)
    kind = values.dtype.type
    count = cv2.boxFilter(measured.astype(kind), -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
    filled = np.where(measured[..., None], values, kind(0.0))
    layers = [
        cv2.boxFilter(filled[..., i], -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
        for i in range(values.shape[-1])
    ]
    some = count > 0.5
    count[~some] = 1.0
    mean: FloatArray = np.stack(layers, axis=-1)
    mean /= count[..., None]
    mean[~some] = np.nan
    return mean


def _difference(values: FloatArray, axis: int) -> FloatArray:
    """Central difference, one-sided at the border."""
    difference: FloatArray = np.gradient(values, axis=axis)
    return difference


def _halves(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Index of every element but the last, and of every element but the first, along ``axis``."""
    before, after = [slice(None), slice(None)], [slice(None), slice(None)]
    before[axis], after[axis] = slice(0, -1), slice(1, None)
    return tuple(before), tuple(after)
