"""Sizes in pixels that mean a size on the object: they grow with the image."""

from __future__ import annotations

REFERENCE_PX = 480
"""Shorter side of the image that such sizes are given for: the thesis's camera has 720 × 480."""


def image_scale(height: int, width: int) -> float:
    """How many times finer an image is than the reference, 1 at the least.

    >>> image_scale(480, 720), image_scale(720, 480), image_scale(240, 360), image_scale(1080, 1920)
    (1.0, 1.0, 1.0, 2.25)
    """
    return max(1.0, min(height, width) / REFERENCE_PX)
