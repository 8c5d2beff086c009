"""Dark round marks in an image: found at any size, measured as ellipses to a few hundredths of a pixel.

Candidates are connected dark regions at several thresholds relative to the local bright level, whose second moments
fit an ellipse. Their outlines are then measured along rays (centroid of the radial gradient) and an ellipse is fitted.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.ellipses import Ellipse, distance_to_ellipse, fit_ellipse, radius_of_ellipse
from rahas.typing import AnyArray, Float32Array, FloatArray

_WORKING_WIDTH = 720
_RELATIVE_LEVELS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
_RAYS = 72
_RADIAL_STEP_PX = 0.25


class Marks(NamedTuple):
    """Dark ellipses of an image, n of them."""

    centre: FloatArray
    """(n, 2) px: x to the right, y down, pixel centres at integers."""
    semi_axes: FloatArray
    """(n, 2) px, the longer first."""
    direction: FloatArray
    """(n,) rad: of the longer axis, from x towards y."""
    edge_rms: FloatArray
    """(n,) px: scatter of the outline about the ellipse."""


class _Candidate(NamedTuple):
    x: float
    y: float
    radius: float
    misfit: float


def find_marks(image: AnyArray, *, min_diameter_px: float = 6.0, max_diameter_share: float = 0.2) -> Marks:
    """Find dark round marks in a grey ``image`` (y, x) of any unit; non-finite pixels count as dark.

    ``max_diameter_share`` is of the image's width. Marks cut by the image's border are left out.
    """
    grey = np.nan_to_num(np.asarray(image, dtype=np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    reduction = max(1.0, grey.shape[1] / _WORKING_WIDTH)
    small = grey
    if reduction > 1.0:
        size = (round(grey.shape[1] / reduction), round(grey.shape[0] / reduction))
        small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    widest = max_diameter_share * small.shape[1]
    candidates = _candidates(small, min_diameter=min_diameter_px, max_diameter=widest)
    factor = np.array([grey.shape[1] / small.shape[1], grey.shape[0] / small.shape[0]])
    blurred = cv2.GaussianBlur(grey, (0, 0), 0.7 * max(1.0, reduction))
    rows = []
    for candidate in candidates:
        centre = (np.array([candidate.x, candidate.y]) + 0.5) * factor - 0.5
        row = _measure(blurred, centre, candidate.radius * float(factor.mean()))
        if row is not None:
            rows.append(row)
    table = np.array(rows).reshape(-1, 6)
    return Marks(table[:, :2], table[:, 2:4], table[:, 4], table[:, 5])


def local_bright_level(image: Float32Array, *, window_px: float) -> Float32Array:
    """Bright envelope of ``image``: closing over ``window_px``, which fills dark regions smaller than that."""
    step = max(1, int(window_px / 16))
    small = cv2.resize(
        image, (max(1, image.shape[1] // step), max(1, image.shape[0] // step)), interpolation=cv2.INTER_AREA
    )
    side = 2 * int(np.ceil(window_px / step / 2)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel, borderType=cv2.BORDER_REPLICATE)
    closed = cv2.GaussianBlur(closed, (0, 0), side / 6)
    level: Float32Array = cv2.resize(closed, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_LINEAR)
    return level


def _candidates(image: Float32Array, *, min_diameter: float, max_diameter: float) -> list[_Candidate]:
    """Elliptical dark regions, the best-fitting threshold of each."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.8)
    level = local_bright_level(smooth, window_px=1.1 * max_diameter)
    lit = level > 0.04 * float(np.percentile(level, 98))
    relative = np.where(lit, smooth / np.maximum(level, 1e-6), 1.0)
    found: list[_Candidate] = []
    for threshold in _RELATIVE_LEVELS:
        found += _elliptical_regions(relative < threshold, min_diameter, max_diameter)
    found.sort(key=lambda candidate: candidate.misfit)
    kept: list[_Candidate] = []
    for candidate in found:
        if all(np.hypot(candidate.x - k.x, candidate.y - k.y) > 0.7 * max(candidate.radius, k.radius) for k in kept):
            kept.append(candidate)
    return kept


def _elliptical_regions(mask: AnyArray, min_diameter: float, max_diameter: float) -> list[_Candidate]:
    count, labels, stats, centroids = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    height, width = mask.shape
    regions = []
    for index in range(1, count):
        left, top, wide, high, area = (int(v) for v in stats[index])
        if (
            not min_diameter <= min(wide, high)
            or max(wide, high) > max_diameter
            or max(wide, high) > 2.5 * min(wide, high)
        ):
            continue
        if left == 0 or top == 0 or left + wide == width or top + high == height:
            continue
        window = labels[top : top + high, left : left + wide] == index
        y, x = np.nonzero(window)
        covariance = np.cov(x, y, bias=True) + np.eye(2) / 12.0
        ellipse_area = 4.0 * np.pi * float(np.sqrt(np.linalg.det(covariance)))
        misfit = abs(area / ellipse_area - 1.0)
        if misfit < 0.06:
            radius = float(np.sqrt(area / np.pi))
            regions.append(_Candidate(float(centroids[index][0]), float(centroids[index][1]), radius, misfit))
    return regions


def _measure(image: Float32Array, centre: FloatArray, radius: float) -> tuple[float, ...] | None:
    """Ellipse (x, y, longer, shorter, direction, scatter) fitted to the outline about ``centre``, or nothing."""
    angle = np.arange(_RAYS) * (2.0 * np.pi / _RAYS)
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.arange(0.4 * radius, 1.7 * radius + 2.0, _RADIAL_STEP_PX)
    points = centre + reach[None, :, None] * directions[:, None, :]
    if points.min() < 0 or points[..., 0].max() > image.shape[1] - 1 or points[..., 1].max() > image.shape[0] - 1:
        reach = reach[: max(8, int(1.3 * radius / _RADIAL_STEP_PX * 0.65))]
        points = centre + reach[None, :, None] * directions[:, None, :]
    maps = points.astype(np.float32)
    values = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    slope = np.diff(values.astype(np.float64), axis=1)
    middle = 0.5 * (reach[1:] + reach[:-1])
    peak = np.argmax(slope, axis=1)
    near = np.abs(middle[None, :] - middle[peak][:, None]) <= 2.5
    weight = np.where(near, np.maximum(slope - 0.25 * slope.max(axis=1, keepdims=True), 0.0), 0.0)
    edge = (weight @ middle) / np.maximum(weight.sum(axis=1), 1e-12)
    strength = slope.max(axis=1)
    usable = (strength > 0.3 * np.median(strength)) & (peak > 0) & (peak < slope.shape[1] - 1)
    outline = centre + edge[:, None] * directions
    ellipse: Ellipse | None = None
    distance: FloatArray = np.zeros(_RAYS, dtype=np.float64)
    for _ in range(4):
        if usable.sum() < _RAYS // 2:
            return None
        ellipse = fit_ellipse(outline[usable])
        if ellipse is None:
            return None
        distance = distance_to_ellipse(outline, ellipse)
        scatter = 1.4826 * float(np.median(np.abs(distance[usable])))
        usable = np.abs(distance) < max(3.0 * scatter, 0.05)
    rms = float(np.sqrt(np.mean(distance[usable] ** 2))) if usable.any() else np.inf
    if ellipse is None or rms > 0.05 * radius + 0.15 or ellipse[3] < 0.4 * ellipse[2]:
        return None
    refined = _refine(image, ellipse)
    return (*ellipse, rms) if refined is None else refined


def _refine(image: Float32Array, ellipse: Ellipse) -> tuple[float, ...] | None:
    """The outline once more, by area: where a sharp edge would leave as much dark, the level outside being a slope.

    Shading and left-over stripes make the level outside the mark uneven; a ray's own straight line takes that out.
    """
    radius = float(np.sqrt(ellipse[2] * ellipse[3]))
    soft = min(2.5, 0.45 * radius)  # half the width of a blurred edge
    outside = float(np.clip(0.4 * radius, 2.5, 4.0))
    angle = np.arange(_RAYS) * (2.0 * np.pi / _RAYS)
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    to_edge = radius_of_ellipse(ellipse, directions)
    offset = np.arange(-soft - 1.5, soft + outside, _RADIAL_STEP_PX)
    points = np.array(ellipse[:2]) + (to_edge[:, None] + offset)[..., None] * directions[:, None, :]
    if points.min() < 0 or points[..., 0].max() > image.shape[1] - 1 or points[..., 1].max() > image.shape[0] - 1:
        return None
    maps = points.astype(np.float32)
    values = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_CUBIC).astype(np.float64)
    dark = float(np.median(values[:, offset < -soft]))
    beyond = offset > soft
    line = np.column_stack([np.ones(int(beyond.sum())), offset[beyond]])
    trend = np.linalg.pinv(line) @ values[:, beyond].T
    bright = trend[0][:, None] + trend[1][:, None] * offset
    edge_window = np.abs(offset) <= soft
    lightness = (values - dark) / np.maximum(bright - dark, 1e-6)
    inner_end = offset[edge_window][0] - _RADIAL_STEP_PX / 2.0
    shift = inner_end + _RADIAL_STEP_PX * np.sum(1.0 - lightness[:, edge_window], axis=1)
    outline = np.array(ellipse[:2]) + (to_edge + shift)[:, None] * directions
    usable = np.abs(shift - np.median(shift)) < 1.0
    fitted: Ellipse | None = None
    for _ in range(3):
        if usable.sum() < _RAYS // 2:
            return None
        fitted = fit_ellipse(outline[usable])
        if fitted is None:
            return None
        distance = distance_to_ellipse(outline, fitted)
        scatter = 1.4826 * float(np.median(np.abs(distance[usable])))
        usable = np.abs(distance) < max(3.0 * scatter, 0.05)
    if fitted is None or not usable.any():
        return None
    return (*fitted, float(np.sqrt(np.mean(distance[usable] ** 2))))
