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


def noise_of_capture(
    *, far_pairs: AnyArray, near_triples: AnyArray, background: AnyArray, residual: AnyArray, top_level: float
) -> NoiseCurve:
    """Noise curve of a capture: the largest, level by level, of what holds, moving stripes and their fit show.

    A lossy codec freezes the picture of a hold, noise and all, and only shows its errors when something moves; so
    consecutive frames of the scan count too, through their second difference, in which moving stripes cancel, and
    the residuals of the scan's fit, through the quarter of the pixels that the stripe model fits best.

    Parameters
    ----------
    far_pairs
        (pair, 2, y, x) grey levels, frames of one hold some ten frames apart (codecs carry noise over to the next).
    near_triples
        (triple, 3, y, x) consecutive frames of the scan; may be none.
    background, residual
        (y, x) grey levels: the fit's mean level and standard deviation.
    top_level
        Highest grey level that the frames can hold.

    Raises
    ------
    ValueError
        There is nothing to measure noise on.
    """
    curves = []
    pairs = far_pairs.astype(np.float32)
    triples = near_triples.astype(np.float32)
    if len(pairs):
        curves.append(_curve(pairs[:, 1] - pairs[:, 0], pairs.mean(axis=1), 2.0, top_level))
    if len(triples):
        second = triples[:, 0] - 2 * triples[:, 1] + triples[:, 2]
        curves.append(_curve(second, triples.mean(axis=1), 6.0, top_level))
    curves.append(_residual_curve(background, residual, top_level))
    known = [curve for curve in curves if curve is not None]
    if not known:
        raise ValueError(f"nothing to measure noise on: {len(pairs)} pairs, {len(triples)} triples, {residual.size} pixels")
    level = np.unique(np.concatenate([curve.level for curve in known]))
    return NoiseCurve(level, np.max([curve.at(level) for curve in known], axis=0))


def _curve(differences: AnyArray, levels: AnyArray, gain: float, top_level: float) -> NoiseCurve | None:
    """Noise from differences (sample, y, x) whose variance is ``gain`` times a frame's.

    Within a sample and a level the difference's mean (flicker, lamp warming up) is taken out and what is beyond four
    standard deviations is left out. Over the samples the lower quartile is taken: what a bump, a passing hand or a
    duplicated frame did to some of them does not count.
    """
    width = (top_level + 1.0) / _BINS
    table = np.array(
        [
            _variance_by_bin(difference.ravel(), level.ravel() / np.float32(width))
            for difference, level in zip(differences, levels, strict=True)
            if difference.any()
        ]
    ).reshape(-1, _BINS)
    seen = np.isfinite(table).sum(0) * 2 >= max(len(table), 1)
    if not seen.any():
        return None
    variance = np.nanquantile(table[:, seen], 0.25, axis=0) / gain
    return NoiseCurve((np.flatnonzero(seen) + 0.5) * width, np.sqrt(np.maximum(variance, _QUANTISATION_VARIANCE)))


def _residual_curve(background: AnyArray, residual: AnyArray, top_level: float) -> NoiseCurve | None:
    width = (top_level + 1.0) / _BINS
    index = np.clip((background / width).astype(np.int64), 0, _BINS - 1).ravel()
    order = np.argsort(index, kind="stable")
    groups = np.split(residual.ravel()[order], np.cumsum(np.bincount(index, minlength=_BINS))[:-1])
    seen = [bin_number for bin_number, group in enumerate(groups) if len(group) >= _LEAST_PIXELS]
    if not seen:
        return None
    sigma = np.array([np.quantile(groups[bin_number], 0.25) for bin_number in seen])
    return NoiseCurve((np.array(seen) + 0.5) * width, np.maximum(sigma, np.sqrt(_QUANTISATION_VARIANCE)))


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
