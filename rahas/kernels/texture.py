"""The object's own texture, told apart from the stripes that move over it.

A bump moves camera and projector together against the object: the texture shifts in the image while the pattern
stays, so whoever registers the frames as they are follows the stripes. In the logarithm of light, surface and
pattern add up; a second-order high-pass well below the stripe pitch takes the stripes out of both the frame and the
template, and what they leave is not correlated with the texture.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import AnyArray, Float32Array

_PITCH_TO_SIGMA = 8.0
_PREFILTER_SIGMA = 0.7


class TextureFrame(NamedTuple):
    """One frame, its stripes suppressed."""

    pattern: Float32Array
    """Texture (y, x): high-passed natural logarithm of the light, no unit."""
    light: Float32Array
    """Local mean of the light (y, x), grey levels above ``offset``."""


def high_pass_sigma(pitch: float) -> float:
    """Width of the low-pass that the texture is freed of, pixels, for a stripe pitch in pixels."""
    return float(np.clip(pitch / _PITCH_TO_SIGMA, 1.2, 4.0))


def texture_from_luma(luma: AnyArray, *, black_level: float, offset: float, sigma: float) -> TextureFrame:
    """Texture of a frame, or of the stripe-free background.

    Parameters
    ----------
    luma
        (y, x) grey levels.
    black_level
        Grey level of no light.
    offset
        Grey levels added to the light before the logarithm, some σ of noise: dark troughs of the pattern must not
        be blown up.
    sigma
        Width of the low-pass, pixels (:func:`high_pass_sigma`).
    """
    light = luma.astype(np.float32) + np.float32(offset - black_level)
    light = np.maximum(light, np.float32(0.5 * offset))
    logarithm = np.log(light)
    once = logarithm - _blur(logarithm, sigma)
    twice = once - _blur(once, sigma)
    return TextureFrame(_blur(twice, _PREFILTER_SIGMA), _blur(light, sigma))


def _blur(values: Float32Array, sigma: float) -> Float32Array:
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REFLECT), dtype=np.float32)
