"""Noise of one frame, by grey level, from pictures of the same unmoving scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rahas.typing import AnyArray, FloatArray

_BINS = 64
_LEAST_PIXELS = 200
_QUANTISATION_VARIANCE = 1.0 / 12.0


class NoiseCurve(NamedTuple):
    """Standard deviation of one pixel of one frame as a function of its grey level."""

    level: FloatArray
    """Grey levels, rising (grey levels of the stack)."""
    sigma: FloatArray
    """Noise at those levels, never below the rounding to whole levels (grey levels)."""

    def at(self, level: npt.ArrayLike) -> FloatArray:
        """Noise at any grey level; beyond the measured range the nearest measured one."""
        return np.interp(np.asarray(level, dtype=np.float64), self.level, self.sigma)


def noise_from_differences(
    differences: AnyArray, levels: AnyArray, *, gain: float, top_level: float
) -> NoiseCurve | None:
    """Noise curve from differences of frames that show the same scene; ``None`` without two different frames.

    Within a sample and a level the difference's mean (flicker, lamp warming up) is taken out and what is beyond four
    standard deviations is left out. Over the samples the lower quartile is taken: what a bump, a passing hand or a
    duplicated frame did to some of them does not count.

    Parameters
    ----------
    differences, levels
        (sample, y, x) grey levels: the difference, and the level that it was seen at.
    gain
        Variance of such a difference in variances of one frame: 2 for I₁ − I₂, 6 for I₁ − 2 I₂ + I₃.
    top_level
        Highest grey level that the frames can hold.
    """
    width = (top_level + 1.0) / _BINS
    table = np.array(
        [
            _variance_by_bin(difference.ravel(), level.ravel() / width)
            for difference, level in zip(differences, levels, strict=True)
            if difference.any()
        ]
    ).reshape(-1, _BINS)
    seen = np.isfinite(table).sum(0) * 2 >= max(len(table), 1)
    if not seen.any():
        return None
    variance = np.nanquantile(table[:, seen], 0.25, axis=0) / gain
    return NoiseCurve((np.flatnonzero(seen) + 0.5) * width, np.sqrt(np.maximum(variance, _QUANTISATION_VARIANCE)))


def noise_from_residual(residual: AnyArray, levels: AnyArray, *, top_level: float) -> NoiseCurve | None:
    """Noise curve from a fit's standard deviation (y, x): of each level, the quarter that the model fits best."""
    width = (top_level + 1.0) / _BINS
    index = np.clip((levels / width).astype(np.int64), 0, _BINS - 1).ravel()
    order = np.argsort(index, kind="stable")
    groups = np.split(residual.ravel()[order], np.cumsum(np.bincount(index, minlength=_BINS))[:-1])
    seen = [number for number, group in enumerate(groups) if len(group) >= _LEAST_PIXELS]
    if not seen:
        return None
    sigma = np.array([np.quantile(groups[number], 0.25) for number in seen])
    return NoiseCurve((np.array(seen) + 0.5) * width, np.maximum(sigma, np.sqrt(_QUANTISATION_VARIANCE)))


def combined_noise(
    *, still: NoiseCurve | None, moving: NoiseCurve | None, residual: NoiseCurve | None, lit_level: float
) -> NoiseCurve:
    """Noise curve of a capture from its holds, from its moving stripes and from what their fit leaves.

    A lossy codec freezes what does not move, noise and all: what it hides at ``lit_level`` (grey levels), seen as the
    excess of moving over still frames there, it can hide anywhere, and is added at every level. Else the largest of
    the three counts, level by level.

    Where none of the three is known (a frame of very few pixels), that of rounding alone.
    """
    known = [curve for curve in (still, moving, residual) if curve is not None]
    if not known:
        rounding = np.full(2, np.sqrt(_QUANTISATION_VARIANCE))
        return NoiseCurve(np.array([0.0, max(lit_level, 1.0)]), rounding)
    level = np.unique(np.concatenate([curve.level for curve in known]))
    largest = np.max([curve.at(level) for curve in known], axis=0)
    hidden = 0.0
    if still is not None and moving is not None:
        hidden = max(float(moving.at(lit_level)) ** 2 - float(still.at(lit_level)) ** 2, 0.0)
    return NoiseCurve(level, np.maximum(largest, np.sqrt(_QUANTISATION_VARIANCE + hidden)))


def _variance_by_bin(difference: AnyArray, bins: AnyArray) -> FloatArray:
    """Variance of the differences in each grey-level bin (bin,), NaN where too few pixels are."""
    index = np.clip(bins.astype(np.int64), 0, _BINS - 1)
    limit = np.full(_BINS, np.inf)
    centre = np.zeros(_BINS)
    variance = np.full(_BINS, np.nan)
    for _ in range(3):
        kept = np.abs(difference - centre[index]) <= limit[index]
        chosen, values = index[kept], difference[kept].astype(np.float64)
        count = np.bincount(chosen, minlength=_BINS)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(chosen, values, minlength=_BINS) / count
            square = np.bincount(chosen, values * values, minlength=_BINS) / count
        variance = np.where(count >= _LEAST_PIXELS, square - mean * mean, np.nan)
        centre = np.where(np.isfinite(mean), mean, 0.0)
        limit = np.where(np.isfinite(variance), np.maximum(4.0 * np.sqrt(np.maximum(variance, 0.0)), 1.5), np.inf)
    return variance
