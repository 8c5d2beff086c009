"""Phase corrections from one still image whose background and modulation are known.

In the first hold the slide stands still at its first stop, and a pixel shows

    I = g·a + o + b·Σ_h (C_h cos hΦ0 + S_h sin hΦ0),   h = 1, 2, 3

with its background a and modulation b known from the scan, gain g, offset o and waveform C, S shared by all pixels,
S_1 = 0. Φ0 = start + columns·p is fitted by Gauss–Newton with Cauchy weights. What is left over hangs together over
many pixels (texture, the codec's blocks), so the covariance is the sandwich over the cells of a grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, FloatArray, IntArray

_HARMONICS = (1, 2, 3)
_NUISANCES = 2 * len(_HARMONICS) + 1  # g, o, C_h, and S_h but for the first
_CUT = 2.5  # robust standard deviations at which a residual counts half
_CELLS = (12, 16)


class HoldPixels(NamedTuple):
    """Pixels of the first hold, n of them."""

    level: FloatArray
    """(n,) grey levels, mean of the hold's still frames."""
    background: FloatArray
    """(n,) a, grey levels."""
    modulation: FloatArray
    """(n,) b, grey levels."""
    cell: IntArray
    """(n,) number of the part of the image that each lies in."""


class HoldFit(NamedTuple):
    """One Gauss–Newton step, and how well the image was explained before it."""

    change: FloatArray
    """(p,) to be added to the parameters."""
    covariance: FloatArray
    """(p, p)."""
    contrast: float
    """C_1: modulation of the hold over that of the scan; near 0 where the phase is wrong."""
    residual_std: float
    """Robust, grey levels over the median modulation."""


def cells_of(rows: AnyArray, columns: AnyArray, shape: tuple[int, int]) -> IntArray:
    """Number (n,) of the grid cell of each pixel of an image of this shape (y, x)."""
    down, across = (np.asarray(at) * n // size for at, n, size in zip((rows, columns), _CELLS, shape, strict=True))
    return np.asarray(down * _CELLS[1] + across, dtype=np.int64)


def hold_step(pixels: HoldPixels, phase: FloatArray, columns: FloatArray) -> HoldFit:
    """One step from ``phase`` (n,) rad, whose derivatives by the parameters are ``columns`` (n, p).

    Raises
    ------
    ValueError
        Too few pixels for the parameters.
    """
    unknowns = _NUISANCES + columns.shape[1]
    if len(phase) < 4 * unknowns:
        raise ValueError(f"{len(phase)} pixels for {unknowns} unknowns")
    b = pixels.modulation
    waves = [b * np.cos(phase)]
    for h in _HARMONICS[1:]:
        waves += [b * np.cos(h * phase), b * np.sin(h * phase)]
    linear = np.column_stack([pixels.background, np.ones_like(b), *waves])
    weight = np.ones(len(phase))
    scale = 1.0
    for _ in range(4):  # the waveform first: the phase's derivatives need it
        shared = _solved(linear, weight, pixels.level)
        residual = pixels.level - linear @ shared
        scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-6
        weight = 1.0 / (1.0 + (residual / (_CUT * scale)) ** 2)
    slope = -shared[2] * b * np.sin(phase)
    for number, h in enumerate(_HARMONICS[1:]):
        cosine, sine = shared[3 + 2 * number : 5 + 2 * number]
        slope += h * b * (sine * np.cos(h * phase) - cosine * np.sin(h * phase))
    design = np.column_stack([linear, slope[:, None] * columns])
    size = np.sqrt(np.mean(design**2, axis=0)) + 1e-12
    design /= size
    normal = design.T @ (weight[:, None] * design) + 1e-9 * np.sum(weight) * np.eye(unknowns)
    inverse = np.linalg.inv(normal)
    solution = inverse @ (design.T @ (weight * residual))
    left = residual - design @ solution
    scores = np.zeros((int(pixels.cell.max()) + 1, unknowns))
    np.add.at(scores, pixels.cell, (weight * left)[:, None] * design)
    spread = inverse @ (scores.T @ scores) @ inverse / np.outer(size, size)
    return HoldFit(
        (solution / size)[_NUISANCES:],
        spread[_NUISANCES:, _NUISANCES:],
        float(abs(shared[2])),
        scale / float(np.median(b)),
    )


def _solved(design: FloatArray, weight: FloatArray, right: FloatArray) -> FloatArray:
    weighted = design * weight[:, None]
    solution: FloatArray = np.linalg.lstsq(weighted.T @ design, weighted.T @ right, rcond=None)[0]
    return solution
