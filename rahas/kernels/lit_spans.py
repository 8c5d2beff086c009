"""Pixels that the pattern's light leaves, or reaches, during the scan: fitted on the frames in which it shines.

As the crank turns, the edge of the slide's aperture crosses the pixels near the border of the light. Their frames
before (or after) the crossing still hold a phase if the arc is long enough.
"""

from __future__ import annotations

import numpy as np

from rahas.kernels.normal_sums import SUMS, solve_sums
from rahas.typing import BoolArray, FloatArray

CUTS = 24
MARGIN = 2  # frames beside the cut: the edge needs a moment to cross a pixel
CHUNK_SAMPLES = 400_000  # pixels times frames looked at together


def lit_spans(
    levels: FloatArray, delta: FloatArray, noise: FloatArray, *, min_arc: float, tolerance: float
) -> tuple[BoolArray, FloatArray]:
    """Each pixel's longest run of frames, from the first or to the last, that follows a cosine.

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
    used
        (frame, pixel), nowhere true where no run follows the model.
    phase
        (pixel,), radians, of the cosine.
    """
    size = max(1, CHUNK_SAMPLES // len(levels))
    parts = [
        _chunk(levels[:, p : p + size], delta[:, p : p + size], noise[p : p + size], min_arc, tolerance)
        for p in range(0, levels.shape[1], size)
    ]
    used, phases = zip(*parts, strict=True)
    return np.concatenate(used, axis=1), np.concatenate(phases)


def _chunk(
    levels: FloatArray, delta: FloatArray, noise: FloatArray, min_arc: float, tolerance: float
) -> tuple[BoolArray, FloatArray]:
    frames, pixels = levels.shape
    cosine, sine, one = np.cos(delta), np.sin(delta), np.broadcast_to(1.0, delta.shape)
    pairs = (one, one), (one, cosine), (one, sine), (cosine, cosine), (cosine, sine), (sine, sine)
    sums = np.zeros((frames + 1, pixels, SUMS))
    for k, (f, g) in enumerate((*pairs, (one, levels), (cosine, levels), (sine, levels), (levels, levels))):
        np.cumsum(f * g, axis=0, out=sums[1:, :, k])
    used, phase = np.zeros((frames, pixels), dtype=bool), np.zeros(pixels)
    lengths = np.unique(np.linspace(frames, frames * 0.3, CUTS).astype(int))[::-1]
    for length in lengths:
        for start, end in ((0, max(4, length - MARGIN)), (min(frames - 4, frames - length + MARGIN), frames)):
            found = solve_sums(sums[end] - sums[start])
            arc = np.ptp(delta[start:end], axis=0)
            fits = ~used.any(axis=0) & (found.noise < tolerance * noise) & (arc >= min_arc)
            used[start:end, fits] = True
            phase[fits] = np.arctan2(-found.second[fits], found.first[fits])
    return used, phase
