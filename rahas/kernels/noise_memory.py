"""How much worse a phase is than white noise would make it: frames whose errors are not independent of each other.

Video compression carries a block's error on from frame to frame, so that a pixel's frames hold less news than their
number says, and a standard deviation from the residuals alone is too small. Two halves of the frames, cut into
alternating blocks long enough to forget each other, give two phases; their difference, over what the residuals'
standard deviation makes of it, is the factor.
"""

from __future__ import annotations

import numpy as np

from rahas.typing import FloatArray

BLOCKS = 6
MIN_BLOCK = 5  # frames
RIDGE = 1e-6


def phase_std_inflation(residual: FloatArray, value: FloatArray, slope: FloatArray) -> float:
    """Factor on the phase's standard deviation, 1 at least.

    Parameters
    ----------
    residual
        (frame, pixel), what the fit of a + b·w(φ + δ) leaves.
    value, slope
        (frame, pixel), w and w′.

    Returns
    -------
    factor
        1 where errors are as independent as white noise, and where there are too few frames to tell.
    """
    frames, pixels = residual.shape
    length = max(MIN_BLOCK, frames // BLOCKS)
    side = (np.arange(frames) // length) % 2 == 0
    if side.all() or min(side.sum(), (~side).sum()) < 3 * MIN_BLOCK or pixels < 2:
        return 1.0
    turned, variance = zip(*(_turned(residual[half], value[half], slope[half]) for half in (side, ~side)), strict=True)
    noise = np.sqrt(np.square(residual, dtype=np.float64).sum(axis=0) / (frames - 3))
    expected = noise * np.sqrt(variance[0] + variance[1])
    ratio = (turned[0] - turned[1]) / np.maximum(expected, 1e-12)
    return max(1.0, float(1.4826 * np.median(np.abs(ratio - np.median(ratio)))))


def _turned(residual: FloatArray, value: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Change of b·φ (pixel,) that these frames alone would make, and its variance in units of the noise's."""
    columns = np.stack([np.ones_like(value), value, slope], axis=-1).transpose(1, 0, 2).astype(np.float64)
    normal = columns.transpose(0, 2, 1) @ columns
    inverse = np.linalg.inv(normal + RIDGE * residual.shape[0] * np.eye(3))
    right = np.einsum("pni,np->pi", columns, residual)
    return np.einsum("pi,pi->p", inverse[:, 2], right), inverse[:, 2, 2]
