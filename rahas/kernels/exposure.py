"""Which pixels of the object the sensor could not follow: too bright or too dark to be seen moving."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, BoolArray

_SAMPLES_AT_TOP = 0.1
_SAMPLES_AT_BOTTOM = 0.3


class SensorLimits(NamedTuple):
    """Grey levels at which the capture is cut off."""

    bottom: float
    top: float


class Clipped(NamedTuple):
    """Pixels that spend a good part of the scan at a limit, each (y, x) bool."""

    low: BoolArray
    high: BoolArray


def sensor_limits(samples: AnyArray, *, bit_depth: int, luma_range: str) -> SensorLimits:
    """Where the capture is cut off, told from its own frames.

    Limited-range luma stops at 16 and 235 in some cameras and reaches into super-white and super-black in others:
    what the frames go beyond is not their limit.

    Parameters
    ----------
    samples
        (sample, y, x), lit frames as shot.
    luma_range
        ``limited``, ``full`` or ``unknown``.
    """
    unit = 2.0 ** (bit_depth - 8)
    darkest, brightest = np.percentile(samples, (0.01, 99.99))
    bottom, top = 0.0, 2.0**bit_depth - 1
    if luma_range != "full" and brightest <= 239 * unit:
        top = 235 * unit
    if luma_range == "limited" and darkest >= 12 * unit:
        bottom = 16 * unit
    return SensorLimits(bottom, top)


def clipped_from_samples(samples: AnyArray, limits: SensorLimits, *, bit_depth: int) -> Clipped:
    """Pixels at a limit in a tenth of the samples (top), or in three tenths (bottom: a full trough is dark for long).

    A codec's ringing is allowed for: two levels (of 8 bits) at the top, one at the bottom.
    """
    unit = 2.0 ** (bit_depth - 8)
    high = (samples >= limits.top - 2 * unit).mean(axis=0) >= _SAMPLES_AT_TOP
    low = (samples <= limits.bottom + unit).mean(axis=0) >= _SAMPLES_AT_BOTTOM
    return Clipped(np.asarray(low), np.asarray(high))
