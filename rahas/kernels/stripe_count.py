"""How many stripes the first frame shows, and how far apart: thesis 3.4.2, ``findNumSnakes``."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import AnyArray

MIN_PITCH_PX = 6.0
"""Finer stripes than this cannot be followed from frame to frame."""
MIN_STRIPES = 2.5
"""Fewer periods than this over the canvas cannot be told from a gradient of light."""
_LINES = 128  # transformed at a time
_TILT_LIMIT = 0.45
"""Largest |fx / fy| of stripes that count as horizontal (24°)."""


class StripeCount(NamedTuple):
    """Stripes of a frame at epipolar alignment, un-rotated."""

    pitch_px: float
    """Mean distance of stripes along y, pixels."""
    stripes: int
    """Stripes over the canvas height that shows the image."""
    strength: float
    """The spectral peak over the median of the band searched: 1 is noise."""


def find_num_snakes(columns: AnyArray) -> StripeCount:
    """Pitch and number of the stripes of a normalised, un-rotated frame by its 2-D FFT (``findNumSnakes``).

    Parameters
    ----------
    columns
        (x, y) pattern, about 0 on average, 0 where there is nothing to see.

    Raises
    ------
    ValueError
        There is no room for stripes of ``MIN_PITCH_PX`` on the canvas.
    """
    nx, ny = columns.shape
    rows_seen = np.flatnonzero(np.any(columns != 0, axis=0))
    if rows_seen.size < MIN_STRIPES * MIN_PITCH_PX:
        raise ValueError(f"{rows_seen.size = } canvas rows show the image, expected {MIN_STRIPES * MIN_PITCH_PX:.0f}")
    span = int(rows_seen[-1] - rows_seen[0] + 1)
    fx_size, fy_size = cv2.getOptimalDFTSize(nx), cv2.getOptimalDFTSize(2 * ny)
    window = np.ones(ny)
    window[rows_seen[0] : rows_seen[-1] + 1] = np.hanning(span)
    fy = np.fft.rfftfreq(fy_size)
    fy = fy[: int(np.searchsorted(fy, 1 / MIN_PITCH_PX)) + 2]  # what lies above is not looked at
    spectrum = np.empty((nx, fy.size), np.complex128)
    for x in range(0, nx, _LINES):
        lines = columns[x : x + _LINES] * (np.hanning(nx)[x : x + _LINES, None] * window)
        spectrum[x : x + _LINES] = np.fft.rfft(lines, fy_size)[:, : fy.size]
    power = np.abs(np.fft.fft(spectrum, fx_size, axis=0)) ** 2
    fx = np.abs(np.fft.fftfreq(fx_size))[:, None]
    band = (fy >= MIN_STRIPES / span) & (fy <= 1 / MIN_PITCH_PX) & (fx <= _TILT_LIMIT * fy)
    searched = np.where(band, power, 0.0)
    best_x, best_y = np.unravel_index(int(np.argmax(searched)), searched.shape)
    peak = float(searched[best_x, best_y])
    row = power[best_x]
    shift = 0.0
    if 0 < best_y < row.size - 1:
        left, mid, right = np.log(row[best_y - 1 : best_y + 2] + 1e-12 * peak + 1e-300)
        bend = left - 2 * mid + right
        shift = float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0 else 0.0
    pitch = fy_size / (best_y + shift)
    noise = float(np.median(power[band]))
    return StripeCount(float(pitch), round(span / pitch), peak / noise if noise > 0 else float(peak > 0))
