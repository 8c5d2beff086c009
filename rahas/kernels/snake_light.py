"""Light taken out of frames before stripes are sought: balance, smoothing, and the pattern alone (thesis 3.4.1).

The thesis balances the frames' brightness and smooths them with a median and a moving average. A stripe's brightest
row is then still pulled aside by the surface's own shading. Over rotation and scan every lit pixel sees the pattern's
brightest and darkest: midway lies its background a, half the range is its modulation b, and (I − a)/b is the pattern.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import AnyArray, BoolArray, Float32Array

LEVEL_OFFSET = 2.0
"""A pattern value of −1…1 is stored as 1…3, so that ratios (PSR) are well conditioned and 0 can mean nothing seen."""
_LEVEL_LIMITS = (0.5, 3.5)


class LightEnvelope(NamedTuple):
    """What the surface does to the pattern, per pixel of the image."""

    background: Float32Array
    """(y, x) a, grey levels at the reference gain."""
    over_modulation: Float32Array
    """(y, x) 1/b, 0 where not lit."""
    lit: BoolArray
    """(y, x) where the modulation stands out of the noise."""
    mean_level: float
    """Mean grey level to which frames are balanced."""


def smoothed(frame: AnyArray, *, median_px: int, average_px: int) -> Float32Array:
    """Median filter, then moving average, both rectangular; float32 grey levels."""
    calm = cv2.medianBlur(np.ascontiguousarray(frame), median_px) if median_px > 1 else frame
    blurred: Float32Array = cv2.boxFilter(calm, cv2.CV_32F, (average_px, average_px))
    return blurred


def envelope_of_frames(
    frames: Iterable[Float32Array], *, still: tuple[Float32Array, Float32Array], min_modulation_over_noise: float
) -> LightEnvelope:
    """Envelope of smoothed frames of rotation and scan, each brought to the mean level of the first.

    Parameters
    ----------
    frames
        (y, x) smoothed frames in which the pattern moves by a period or more at nearly every pixel.
    still
        Two smoothed frames of one hold: their difference is noise.
    min_modulation_over_noise
        A lit pixel's modulation over the standard deviation of the smoothed noise.
    """
    high: Float32Array | None = None
    low: Float32Array | None = None
    reference = 0.0
    for frame in frames:
        level = float(frame.mean())
        if level <= 0:
            continue
        if high is None or low is None:
            high, low, reference = frame.copy(), frame.copy(), level
            continue
        even = frame * np.float32(reference / level)
        np.maximum(high, even, out=high)
        np.minimum(low, even, out=low)
    if high is None or low is None:
        raise ValueError("no frame with any light was given")
    background = 0.5 * (high + low)
    modulation = 0.5 * (high - low)
    noise = float(np.median(np.abs(still[0] - still[1]))) / (0.6745 * np.sqrt(2.0))
    strong = float(np.percentile(modulation, 95))
    limit = max(min_modulation_over_noise * noise, 0.04 * strong, 1e-3 * reference, 0.5)
    lit = modulation > limit
    over = np.divide(1.0, modulation, out=np.zeros_like(modulation), where=lit)
    return LightEnvelope(background, over, lit, reference)


def balanced(frame: Float32Array, envelope: LightEnvelope) -> Float32Array:
    """A smoothed frame brought to the envelope's mean level: an automatic camera's changes taken out."""
    level = float(frame.mean())
    return frame * np.float32(envelope.mean_level / level if level > 0 else 1.0)


def pattern_levels(frame: Float32Array, envelope: LightEnvelope) -> Float32Array:
    """The pattern alone, cos ψ + ``LEVEL_OFFSET`` (y, x), of a balanced frame; 0 where a pixel is not lit."""
    levels: Float32Array = frame - envelope.background
    levels *= envelope.over_modulation
    levels += np.float32(LEVEL_OFFSET)
    np.clip(levels, *_LEVEL_LIMITS, out=levels)
    levels *= envelope.lit
    return levels
