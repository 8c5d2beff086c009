"""Stripe maxima of an un-rotated frame (thesis 3.4.1 and 3.4.2).

``anglePSR``          peak to side-lobe ratio, equation 3.2
``snakeMaskPeakPSR``  snake mask D: 255 at each peak, 128 around it, 0 elsewhere, equations 3.3–3.5
``collapseSlice``     sum of D over a narrow band of columns, equation 3.6
``findCollapsePeaks`` maxima of that sum, with plateaus of two and three pixels, equation 3.7

Images are canvas columns (x, y) of levels > 0; 0 means that nothing was seen there.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.typing import AnyArray, BoolArray, ByteArray, Float32Array, FloatArray, IntArray

PEAK = 255
TRANSITION = 128


class PeakRule(NamedTuple):
    """When a local maximum is a stripe."""

    sidelobe_px: int
    """r: distance from the peak to the side lobes it is compared with, a little less than half a pitch."""
    min_psr: float
    """Smallest peak to side-lobe ratio."""
    min_level: float
    """Smallest level at the peak."""
    half_window_px: int
    """The parabola that places the peak spans this many pixels on each side of it."""
    min_separation_px: float
    """Of two maxima closer than this, the brighter one is the stripe."""


class Peaks(NamedTuple):
    """Snake mask of a frame and its peaks, column by column, top to bottom."""

    mask: ByteArray
    """(x, y) the trinary snake mask D."""
    y: Float32Array
    """(x, slot) sub-pixel row of each peak; only the first ``counts`` slots of a column are set."""
    counts: AnyArray
    """(x) int32 number of peaks of each column."""


def angle_psr(columns: AnyArray, sidelobe_px: int) -> FloatArray:
    """``anglePSR``: A(y) / max(A(y − r), A(y + r)), equation 3.2; a side lobe that is not seen does not count.

    0 where the pixel, or both of its side lobes, are not seen.
    """
    a = np.asarray(columns, dtype=np.float64)
    r = sidelobe_px
    lobe = np.zeros_like(a)
    lobe[:, r:] = a[:, :-r]
    lobe[:, :-r] = np.maximum(lobe[:, :-r], a[:, r:])
    return np.divide(a, lobe, out=np.zeros_like(a), where=lobe > 0)


def snake_mask_peak_psr(columns: Float32Array, rule: PeakRule) -> Peaks:
    """``snakeMaskPeakPSR``: in each run of pixels over both thresholds the one of greatest PSR (equations 3.3–3.5).

    Beyond the thesis, each peak is placed between pixels by a least-squares parabola through the levels around it;
    a run whose maximum lies beyond its ends, or next to a pixel that is not seen, stays ``TRANSITION``.
    """
    nx, ny = columns.shape
    slots = int(ny / max(rule.min_separation_px, 2.0)) + 2
    mask = np.zeros((nx, ny), np.uint8)
    y = np.full((nx, slots), np.nan, np.float32)
    count = np.zeros(nx, np.int32)
    _mask_and_peaks(columns, *rule, mask, y, count)
    used = max(int(count.max(initial=0)), 1)
    return Peaks(mask, np.ascontiguousarray(y[:, :used]), count)


def collapse_slice(mask: ByteArray, x_mid: int, half_width_px: int) -> IntArray:
    """``collapseSlice``: r_s(y) = Σ D(x_mid + i, y) over |i| ≤ half width, equation 3.6 (PEAK pixels only).

    Rows next to a peak row count half, so that a stripe that wavers between two rows makes one maximum.
    """
    band = mask[max(0, x_mid - half_width_px) : x_mid + half_width_px + 1] == PEAK
    hits = np.pad(band.sum(axis=0), 1)
    collapsed: IntArray = (hits[:-2] + 2 * hits[1:-1] + hits[2:]).astype(np.int64)
    return collapsed


def find_collapse_peaks(collapsed: IntArray) -> BoolArray:
    """``findCollapsePeaks``: local maxima, the middle of plateaus of two and three pixels included (equation 3.7).

    >>> find_collapse_peaks(np.array([0, 3, 1, 0, 2, 2, 0, 1, 1, 1, 0])).nonzero()[0].tolist()
    [1, 4, 8]
    """
    r = np.pad(np.asarray(collapsed), (1, 3))
    here, before, next1, next2, next3 = r[1:-3], r[:-4], r[2:-2], r[3:-1], r[4:]
    rising = here > before
    single = rising & (here > next1)
    double = rising & (here == next1) & (here > next2)
    triple = rising & (here == next1) & (here == next2) & (here > next3)
    peaks: BoolArray = single | double
    peaks[1:] |= triple[:-1]
    return peaks


@numba.njit(cache=True, nogil=True)
def _mask_and_peaks(
    columns: Float32Array,
    sidelobe: int,
    min_psr: float,
    min_level: float,
    half_window: int,
    min_separation: float,
    mask: ByteArray,
    peak_y: Float32Array,
    peak_count: AnyArray,
) -> None:
    nx, ny = columns.shape
    slots = peak_y.shape[1]
    for x in range(nx):
        column = columns[x]
        count = 0
        best = -1
        best_psr = 0.0
        last_level = 0.0
        last_row = -1
        for y in range(ny + 1):
            psr = 0.0
            if y < ny and column[y] >= min_level:
                lobe = 0.0
                if y >= sidelobe:
                    lobe = column[y - sidelobe]
                if y + sidelobe < ny and column[y + sidelobe] > lobe:
                    lobe = column[y + sidelobe]
                if lobe > 0 and column[y] >= min_psr * lobe:
                    psr = column[y] / lobe
            if psr > 0:
                mask[x, y] = 128
                if psr > best_psr:
                    best_psr = psr
                    best = y
                continue
            if best < 0:
                continue
            row, offset, level = _place(column, best, half_window)
            best = -1
            best_psr = 0.0
            if row < 0 or mask[x, row] != 128:
                continue
            if count > 0 and row + offset - peak_y[x, count - 1] < min_separation:
                if level <= last_level:
                    continue
                mask[x, last_row] = 128
                count -= 1
            if count == slots:
                continue
            mask[x, row] = 255
            peak_y[x, count] = row + offset
            last_level = level
            last_row = row
            count += 1
        peak_count[x] = count


@numba.njit(cache=True, nogil=True)
def _place(column: Float32Array, start: int, half_window: int) -> tuple[int, float, float]:
    """Row and offset (|offset| ≤ 0.5) of the vertex of the parabola nearest ``start``, and its level; row −1: none."""
    ny = column.size
    w = half_window
    n = 2.0 * w + 1.0
    s2 = w * (w + 1.0) * n / 3.0
    s4 = s2 * (3.0 * w * w + 3.0 * w - 1.0) / 5.0
    row = start
    for _ in range(2 * w + 2):
        if row - w < 0 or row + w >= ny:
            return -1, 0.0, 0.0
        total = 0.0
        first = 0.0
        second = 0.0
        for i in range(-w, w + 1):
            a = column[row + i]
            if a <= 0:
                return -1, 0.0, 0.0
            total += a
            first += i * a
            second += i * i * a
        slope = first / s2
        bend = (n * second - s2 * total) / (n * s4 - s2 * s2)
        if bend >= 0:
            return -1, 0.0, 0.0
        offset = -0.5 * slope / bend
        if abs(offset) <= 0.5:
            return row, offset, total / n
        row += 1 if offset > 0 else -1
    return -1, 0.0, 0.0
