"""Pixels that the pattern's light leaves, or reaches, during the scan: fitted on the frames in which it shines.

As the crank turns, the edge of the slide's aperture crosses the pixels near the border of the light. Their frames
before (or after) the crossing still hold a phase if the arc is long enough.
"""

from __future__ import annotations

import numpy as np

from rahas.kernels.normal_sums import SUMS, Solution, solve_sums
from rahas.typing import FloatArray

CUTS = 24
MARGIN = 2  # frames beside the cut: the edge needs a moment to cross a pixel
CHUNK = 2048  # pixels


def solve_lit_spans(
    levels: FloatArray, delta: FloatArray, noise: FloatArray, *, min_arc: float, tolerance: float
) -> Solution:
    """Fit each pixel on its longest run of frames, from the first or to the last, that follows the model.

    Parameters
    ----------
    levels, delta
        (frame, pixel): grey levels, and steps in radians.
    noise
        (pixel,): grey levels, the residual that a pixel in the light has.
    min_arc
        Radians; shorter runs are not used.
    tolerance
        A run follows the model while its residual is below ``tolerance`` times the noise.

    Returns
    -------
    solution
        Amplitudes 0 where no run follows the model.
    """
    parts = [
        _solve_chunk(levels[:, p : p + CHUNK], delta[:, p : p + CHUNK], noise[p : p + CHUNK], min_arc, tolerance)
        for p in range(0, levels.shape[1], CHUNK)
    ]
    return Solution(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _solve_chunk(
    levels: FloatArray, delta: FloatArray, noise: FloatArray, min_arc: float, tolerance: float
) -> Solution:
    frames, pixels = levels.shape
    cosine, sine = np.cos(delta), np.sin(delta)
    one = np.ones_like(cosine)
    products = (
        *(one, cosine, sine, cosine * cosine, cosine * sine, sine * sine),
        *(levels, levels * cosine, levels * sine, levels * levels),
    )
    sums = np.zeros((frames + 1, pixels, SUMS))
    for k, product in enumerate(products):
        np.cumsum(product, axis=0, out=sums[1:, :, k])
    best = Solution(*(np.zeros(pixels) for _ in Solution._fields))
    done = np.zeros(pixels, dtype=bool)
    lengths = np.unique(np.linspace(frames, frames * 0.3, CUTS).astype(int))[::-1]
    for length in lengths:
        for start, end in ((0, max(4, length - MARGIN)), (min(frames - 4, frames - length + MARGIN), frames)):
            found = solve_sums(sums[end] - sums[start])
            arc = np.ptp(delta[start:end], axis=0)
            fits = ~done & (found.noise < tolerance * noise) & (arc >= min_arc)
            for target, value in zip(best, found, strict=True):
                target[fits] = value[fits]
            done |= fits
    return best
