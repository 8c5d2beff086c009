"""Displacement of the object in the image, frame by frame, and its rms in the worst second.

For a frame's texture y and the template's t (:mod:`rahas.kernels.texture`), weighted by the light that each pixel
had, least squares of ``y(p + k) ≈ c·t(p) − c·d·∇t(p)`` with whole pixels k taken out beforehand: d is the rest below
a pixel, c says how much of the template is found again (1: all, 0: nothing).
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.texture import TextureFrame
from rahas.typing import BoolArray, Float32Array, FloatArray

_MARGIN = 24
_TILE = 16
_ROUNDS = 5
_LINEAR = 0.7
_LOST_SCALE = 0.55
_LEAST_SCALE = 0.1
_LEAST_POWER = 0.1
_LEAST_SIGNIFICANCE = 6.0
_WORST_CONDITION = 1e8


class Template(NamedTuple):
    """What the frames are compared with."""

    pattern: Float32Array
    """t (y, x)."""
    gradient_x: Float32Array
    gradient_y: Float32Array
    mask: Float32Array
    """1 where the object is, 0 elsewhere (y, x)."""
    power: float
    """Sum of the squared light over the mask, grey levels squared."""


class Displacement(NamedTuple):
    """Where the object is in one frame, against the template."""

    x: float
    """Pixels to the right."""
    y: float
    """Pixels down."""
    scale: float
    """c: share of the template's texture that the frame shows."""
    std: float
    """Predicted standard deviation of the displacement (root of both axes' mean square), pixels."""
    misfit: float
    """Weighted rms of what the fit leaves, as a texture: an edge in place of the object's inside makes it large."""


def template_from_texture(still: TextureFrame, mask: BoolArray) -> Template:
    """Template from the stripe-free background's texture and the object's region (y, x)."""
    gradient_x, gradient_y = _slope(still.pattern), _slope(still.pattern.T.copy()).T
    weight = mask.astype(np.float32)
    power = float((weight * still.light**2).sum())
    return Template(still.pattern, gradient_x, np.ascontiguousarray(gradient_y), weight, power)


def _slope(pattern: Float32Array) -> Float32Array:
    """Derivative along x, exact to the fourth order: plain differences make fine texture look too flat, d too large."""
    weights = np.array([[1.0, -8.0, 0.0, 8.0, -1.0]], np.float32) / 12.0
    return np.asarray(cv2.filter2D(pattern, cv2.CV_32F, weights, borderType=cv2.BORDER_REFLECT), dtype=np.float32)


def displacement_from_texture(
    template: Template, frame: TextureFrame, *, start: tuple[float, float] = (0.0, 0.0)
) -> Displacement | None:
    """Displacement of the object in a frame; ``None`` where the template is not found in it beyond doubt.

    Parameters
    ----------
    start
        (x, y) in pixels: where to look first, the frame before's displacement. Where that fails the whole range of
        ± 24 pixels is searched by correlation.
    """
    found = _refined(template, frame, start)
    if found is None or found.scale < _LOST_SCALE:
        again = _refined(template, frame, _shift_by_correlation(template, frame))
        found = max((one for one in (found, again) if one is not None), key=lambda one: one.scale, default=None)
    return found


def _refined(template: Template, frame: TextureFrame, start: tuple[float, float]) -> Displacement | None:
    height, width = template.pattern.shape
    margin_x, margin_y = min(_MARGIN, width // 4), min(_MARGIN, height // 4)
    inner = (slice(margin_y, height - margin_y), slice(margin_x, width - margin_x))
    parts = (template.pattern, -template.gradient_x, -template.gradient_y)
    columns = np.stack([part[inner].ravel() for part in parts])
    shift_x, shift_y = round(start[0]), round(start[1])
    found = None
    for _ in range(_ROUNDS):
        if abs(shift_x) > margin_x or abs(shift_y) > margin_y:
            return None
        seen = (
            slice(margin_y + shift_y, height - margin_y + shift_y),
            slice(margin_x + shift_x, width - margin_x + shift_x),
        )
        weight = (frame.light[seen] ** 2 * template.mask[inner]).ravel()
        if weight.sum() < _LEAST_POWER * template.power:
            return None  # off the object, or all of it in a trough
        rest = _solved(columns, weight, frame.pattern[seen].ravel(), (height - 2 * margin_y, width - 2 * margin_x))
        if rest is None:
            return None
        found = rest._replace(x=rest.x + shift_x, y=rest.y + shift_y)
        if abs(rest.x) <= _LINEAR and abs(rest.y) <= _LINEAR:
            return found
        shift_x += int(np.clip(round(rest.x), -2, 2))
        shift_y += int(np.clip(round(rest.y), -2, 2))
    return None


def _solved(
    columns: Float32Array, weight: Float32Array, observed: Float32Array, shape: tuple[int, int]
) -> Displacement | None:
    """One weighted least squares of the observed texture (pixel,) on template and gradients (3, pixel)."""
    weighted = columns * weight
    normal = (weighted @ columns.T).astype(np.float64)
    if not np.isfinite(normal).all() or np.linalg.cond(normal) > _WORST_CONDITION:
        return None
    inverse = np.linalg.inv(normal)
    solution = inverse @ (weighted @ observed)
    residual = observed - solution.astype(np.float32) @ columns
    scale_std, std = _std_from_tiles(weighted * residual, inverse, shape)
    scale = float(solution[0])
    if scale < _LEAST_SIGNIFICANCE * scale_std or scale < _LEAST_SCALE:
        return None
    misfit = float(np.sqrt(max(float(weight @ residual**2), 0.0) / max(float(weight.sum()), 1e-9)))
    return Displacement(float(solution[1]) / scale, float(solution[2]) / scale, scale, std / scale, misfit)


def _std_from_tiles(score: Float32Array, inverse: FloatArray, shape: tuple[int, int]) -> tuple[float, float]:
    """Predicted std of c and of c·d from the scatter of the tiles' scores: stripe residues correlate within a tile."""
    rows, columns = max(shape[0] // _TILE, 1), max(shape[1] // _TILE, 1)
    tile_y, tile_x = shape[0] // rows, shape[1] // columns
    tiles = score.reshape(3, *shape)[:, : rows * tile_y, : columns * tile_x]
    sums = tiles.reshape(3, rows, tile_y, columns, tile_x).sum(axis=(2, 4)).reshape(3, -1).astype(np.float64)
    covariance = inverse @ (sums @ sums.T) @ inverse
    variance = np.maximum(np.diagonal(covariance), 0.0)
    return float(np.sqrt(variance[0])), float(np.sqrt(0.5 * (variance[1] + variance[2])))


def _shift_by_correlation(template: Template, frame: TextureFrame) -> tuple[float, float]:
    """Whole-pixel displacement (x, y) of best correlation within ± 24 pixels."""
    target = cv2.dft(template.pattern * template.mask, flags=cv2.DFT_COMPLEX_OUTPUT)
    light = frame.light / max(float(frame.light.max()), 1e-6)
    shown = cv2.dft(frame.pattern * light, flags=cv2.DFT_COMPLEX_OUTPUT)
    product = cv2.mulSpectrums(shown, target, 0, conjB=True)
    correlation = cv2.idft(product, flags=cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT)
    reach_y, reach_x = (min(_MARGIN, size // 4) for size in template.pattern.shape)
    shifts_y, shifts_x = np.r_[0 : reach_y + 1, -reach_y:0], np.r_[0 : reach_x + 1, -reach_x:0]
    near = correlation[np.ix_(shifts_y, shifts_x)]
    row, column = np.unravel_index(int(near.argmax()), near.shape)
    return float(shifts_x[column]), float(shifts_y[row])


def jitter_from_displacement(displacement: FloatArray, time_s: FloatArray, *, window_s: float = 1.0) -> float | None:
    """Jitter in pixels: the largest, over windows of ``window_s``, of the rms 2-D displacement about its mean.

    Parameters
    ----------
    displacement
        (frame, 2) pixels, NaN where unknown; from the start of the rotation to the end of the scan.
    time_s
        (frame,) s, rising.

    Returns
    -------
    float or None
        ``None`` when no window has half of its frames measured. A capture shorter than the window is one window.

    >>> time = np.arange(60) / 30
    >>> swing = np.stack([np.cos(2 * np.pi * 5 * time), 0 * time], axis=1)
    >>> round(jitter_from_displacement(swing, time), 2)
    0.71
    """
    known = np.asarray(np.isfinite(displacement).all(axis=1))
    worst: float | None = None
    ends = np.searchsorted(time_s, time_s + window_s - 1e-6)
    whole = [first for first, end in enumerate(ends) if end < len(time_s)] or [0]
    for first in [*whole, whole[-1] + 1] if len(whole) < len(time_s) else whole:
        window = slice(first, int(ends[first]))
        chosen = displacement[window][known[window]]
        if len(chosen) < 2 or 2 * len(chosen) < len(known[window]):
            continue
        rms = float(np.sqrt(((chosen - chosen.mean(axis=0)) ** 2).sum(axis=1).mean()))
        worst = rms if worst is None else max(worst, rms)
    return worst
