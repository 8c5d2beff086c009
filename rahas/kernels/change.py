"""By how much a measurement changed from one processing of the same frames to another, pixel by pixel.

Both sides stand on the same camera grid. Their noise is largely common, as they come from the same frames, so a change
of one σ here is more than one σ of a repeated scan.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import FloatArray

TWO_PI = 2.0 * np.pi


class DepthChange(NamedTuple):
    """Change of depth, after minus before."""

    difference_mm: FloatArray
    """(y, x); NaN where one of the two sides measured nothing."""
    compared: int
    """Pixels measured on both sides."""
    gained: int
    """Pixels measured on the second side only."""
    lost: int
    """Pixels measured on the first side only."""
    median_mm: float
    """Median of the signed difference; NaN, like all that follows, where nothing is measured on both sides."""
    rms_mm: float
    """Root of the mean squared difference."""
    p95_mm: float
    """95th percentile of the magnitude."""
    median_sigmas: float
    """Median of magnitude / hypot(σ before, σ after), over pixels where that is positive."""
    rms_sigmas: float
    """Root of the mean square of the same."""
    p95_sigmas: float
    """95th percentile of the same."""


class PhaseChange(NamedTuple):
    """Change of phase, after minus before."""

    compared: int
    """Pixels measured on both sides."""
    orders_changed: int
    """Pixels of these whose unwrapped phase moved to another stripe."""
    rms_rad: float
    """Root of the mean squared difference modulo 2π, in [−π, π); NaN where nothing is measured on both sides."""


def depth_change(
    *, before_mm: FloatArray, after_mm: FloatArray, before_std_mm: FloatArray, after_std_mm: FloatArray
) -> DepthChange:
    """Compare two depth maps of the same grid.

    Parameters
    ----------
    before_mm, after_mm
        (y, x) depth, NaN where nothing was measured.
    before_std_mm, after_std_mm
        (y, x) standard deviation of depth.

    Raises
    ------
    ValueError
        The grids differ in size.
    """
    _check_same_grid(before_mm, after_mm)
    difference = np.asarray(after_mm, dtype=np.float64) - np.asarray(before_mm, dtype=np.float64)
    both = np.isfinite(difference)
    size = np.abs(difference[both])
    std = np.hypot(np.asarray(before_std_mm, dtype=np.float64)[both], np.asarray(after_std_mm, dtype=np.float64)[both])
    known = std > 0
    sigmas = size[known] / std[known]
    return DepthChange(
        difference_mm=difference,
        compared=int(both.sum()),
        gained=int((np.isfinite(after_mm) & ~np.isfinite(before_mm)).sum()),
        lost=int((np.isfinite(before_mm) & ~np.isfinite(after_mm)).sum()),
        median_mm=_percentile(difference[both], 50.0),
        rms_mm=_rms(size),
        p95_mm=_percentile(size, 95.0),
        median_sigmas=_percentile(sigmas, 50.0),
        rms_sigmas=_rms(sigmas),
        p95_sigmas=_percentile(sigmas, 95.0),
    )


def phase_change(*, before_rad: FloatArray, after_rad: FloatArray) -> PhaseChange:
    """Compare two unwrapped phase maps (y, x) of the same grid, NaN where nothing was measured.

    An order counts as changed where the phase moved by more than half a stripe. The stored orders themselves also
    differ where noise carries a wrapped phase across ±π, which changes nothing.

    Raises
    ------
    ValueError
        The grids differ in size.

    Examples
    --------
    >>> before = np.array([[0.1, 3.1, np.nan]])
    >>> phase_change(before_rad=before, after_rad=before + [[0.0, 2 * np.pi, 0.0]])
    PhaseChange(compared=2, orders_changed=1, rms_rad=0.0)
    """
    _check_same_grid(before_rad, after_rad)
    difference = np.asarray(after_rad, dtype=np.float64) - np.asarray(before_rad, dtype=np.float64)
    difference = difference[np.isfinite(difference)]
    stripes = np.floor(difference / TWO_PI + 0.5)
    return PhaseChange(len(difference), int((stripes != 0).sum()), _rms(difference - TWO_PI * stripes))


def _check_same_grid(before: FloatArray, after: FloatArray) -> None:
    if np.shape(before) != np.shape(after):
        raise ValueError(f"the grids differ: {np.shape(before)} before, {np.shape(after)} after")


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _percentile(values: FloatArray, percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else float("nan")
