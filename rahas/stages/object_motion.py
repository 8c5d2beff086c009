"""How the object moves in the image while stripes move over it: the displacement of every frame, and the jitter."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.jitter import displacement_from_texture, jitter_from_displacement, template_from_texture
from rahas.kernels.modulation import StripeFit, pitch_from_fit
from rahas.kernels.texture import high_pass_sigma, texture_from_luma
from rahas.stages.moments import Moments
from rahas.typing import BoolArray, FloatArray

_PATTERN_RATIO = 2.0
_OFFSET_SHARE = 0.2
_LEAST_PIXELS = 500
_MOST_PIXELS = 130_000
_LEAST_FIDELITY = 0.4
_LEAST_FOUND = 0.6
_DOUBTFUL_STD = 2.0
_DOUBTFUL_MISFIT = 2.5
_FRAMES_TO_JUDGE = 10


class ObjectMotion(NamedTuple):
    """What the frames from the start of the rotation to the end of the scan tell of the object's place."""

    displacement: FloatArray
    """(frame, 2) x and y in pixels of the image, NaN outside that range and where the object was not found."""
    jitter: float | None
    """px; ``None`` where there is no texture to measure it on."""
    std: float | None
    """Predicted standard deviation of one frame's displacement (median), px."""
    found_share: float
    """Share of the frames in which the object was found."""


def object_motion(
    moments: Moments,
    fit: StripeFit,
    noise_sigma: FloatArray,
    *,
    time_s: FloatArray,
    first: int,
    last: int,
    scan: tuple[int, int],
    black_level: float,
    largest_std: float,
) -> ObjectMotion:
    """Follow the object from frame ``first`` to ``last``.

    Parameters
    ----------
    fit, noise_sigma
        The scan's background and modulation and one frame's noise on the moments' grid (y, x).
    scan
        First and last frame of the fit.
    largest_std
        px: where displacement is less sure than this, there is no texture to measure it on.
    """
    sigma = high_pass_sigma(pitch_from_fit(fit))
    mask = _texture_region(fit, noise_sigma, margin=int(np.ceil(3 * sigma)))
    displacement = np.full((len(time_s), 2), np.nan)
    scale, std, misfit = (np.full(len(time_s), np.nan) for _ in range(3))
    if mask.sum() < _LEAST_PIXELS:
        return ObjectMotion(displacement, None, None, 0.0)
    window = _window_of(mask)
    offset = max(
        3.0 * float(noise_sigma.min()), _OFFSET_SHARE * float(np.median(fit.background[mask]) - black_level), 1.0
    )
    still = texture_from_luma(fit.background[window], black_level=black_level, offset=offset, sigma=sigma)
    template = template_from_texture(still, mask[window])
    start = (0.0, 0.0)
    for number, block in moments.blocks(first, last):
        for n, frame in enumerate(block, start=number):
            texture = texture_from_luma(frame[window], black_level=black_level, offset=offset, sigma=sigma)
            found = displacement_from_texture(template, texture, start=start)
            if found is not None and not _is_edge(found.misfit, misfit[first:n]):
                start = (found.x, found.y)
                displacement[n] = start
                scale[n], std[n], misfit[n] = found.scale, found.std, found.misfit
    displacement *= moments.factor
    std *= moments.factor
    moving = slice(first, last + 1)
    if np.isfinite(scale).any():
        with np.errstate(invalid="ignore"):
            relative = scale / np.nanmedian(scale)
            doubtful = (std > _DOUBTFUL_STD * largest_std) | (relative < 0.4) | (relative > 2.0)
            doubtful |= misfit > _DOUBTFUL_MISFIT * np.nanmedian(misfit)
        displacement[doubtful] = scale[doubtful] = std[doubtful] = np.nan
    found_share = float(np.isfinite(scale[moving]).mean())
    typical_std = float(np.nanmedian(std)) if found_share else np.inf
    fidelity = _fidelity(scale, scan, moving)
    if found_share < _LEAST_FOUND or fidelity < _LEAST_FIDELITY or typical_std > largest_std:
        known_std = typical_std if np.isfinite(typical_std) else None
        return ObjectMotion(np.full_like(displacement, np.nan), None, known_std, found_share)
    displacement[scan[0] : scan[1] + 1] /= min(fidelity, 1.0)
    jitter = jitter_from_displacement(displacement[moving], time_s[moving])
    return ObjectMotion(displacement, jitter, typical_std, found_share)


def _is_edge(misfit: float, before: FloatArray) -> bool:
    """Whether what was found in a frame is an edge, not the object's inside, judged by the frames before."""
    known = before[np.isfinite(before)]
    return len(known) >= _FRAMES_TO_JUDGE and misfit > _DOUBTFUL_MISFIT * float(np.median(known))


def _fidelity(scale: FloatArray, scan: tuple[int, int], moving: slice) -> float:
    """How much of the template is texture, and not the noise of the scan's own frames, which does not move.

    Frames of the scan find their own noise in the template, others do not; it also holds their displacement back.
    """
    own = np.zeros(len(scale), bool)
    own[scan[0] : scan[1] + 1] = True
    inside, outside = scale[own], scale[moving][~own[moving]]
    if not np.isfinite(inside).any() or not np.isfinite(outside).any():
        return 0.0
    missed = np.nan_to_num(outside, nan=0.0)
    return float(np.median(missed) / np.nanmedian(inside))


def _texture_region(fit: StripeFit, noise_sigma: FloatArray, *, margin: int) -> BoolArray:
    """Lit by the pattern, dark marks included, and ``margin`` pixels off shadows and edges (which go with the rig)."""
    lit = (fit.modulation >= _PATTERN_RATIO * noise_sigma).astype(np.uint8)
    square = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    return np.asarray(cv2.erode(lit, square, borderType=cv2.BORDER_CONSTANT, borderValue=1).astype(bool))


def _window_of(mask: BoolArray) -> tuple[slice, slice]:
    """The part of the image to work on: all of it, or so much around the region's centre as is quick enough."""
    height, width = mask.shape
    shrink = min(1.0, float(np.sqrt(_MOST_PIXELS / mask.size)))
    if shrink == 1.0:
        return slice(0, height), slice(0, width)
    size_y, size_x = int(height * shrink), int(width * shrink)
    rows, columns = np.nonzero(mask)
    top = int(np.clip(np.median(rows) - size_y / 2, 0, height - size_y))
    left = int(np.clip(np.median(columns) - size_x / 2, 0, width - size_x))
    return slice(top, top + size_y), slice(left, left + size_x)
