"""Debanding: the phase error that repeats with the phase itself, measured and taken away (thesis 4.6).

The error is e(Φ) = Σ_k A_k·cos kΦ + B_k·sin kΦ, k = 1…4, with A and B linear in Φ over the field. It is fitted in
projector space, on a grid of image column blocks × phase bins: there a triangular window of two periods holds the
smooth surface and no order, so the phase minus its window holds the error, and relief that does not repeat with the
stripes averages out. Cells may be missing: the orders pass through the same windows as the phase. Sixteen numbers
for a whole field cannot follow relief.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import AnyArray, BoolArray, FloatArray

ORDERS = 4
_BINS = 16
_ROWS = 64  # looked at together: a pixel takes some hundred bytes on the way to its cell
_BLOCK_PX = 4
_STRIPS = 12
_ZONES = 8
_LEAST_STRIPS = 3
_MIN_CELLS = 400
_MIN_COVER = 0.6  # share of a window's weight on cells that are measured


class Banding(NamedTuple):
    """Error of the phase as a function of phase."""

    coefficients: FloatArray
    """(order, 4) rad: A_k, its change from the field's middle to its end, B_k, its change."""
    middle: float
    """Φ at the middle of the field, rad."""
    half_range: float
    """Φ from the middle to the end, rad."""
    ripple: FloatArray
    """(order,) rms amplitude over the field, rad."""
    ripple_std: FloatArray
    """(order,) its standard deviation, from parts of the field left out in turn: strips of columns, then zones of
    phase, for relief that runs along the stripes is the same in every strip, but ripple is there in every zone."""


class Debanded(NamedTuple):
    """Phase with the repeating error taken away."""

    unwrapped_phase: FloatArray
    """(y, x) rad."""
    ripple_before: FloatArray
    """(order,) rms amplitude, rad."""
    ripple_after: FloatArray
    """(order,) rms amplitude of what is left, rad."""
    ripple_std: FloatArray
    """(order,) standard deviation of the first measurement, rad: relief passes for ripple up to that."""
    orders_removed: tuple[int, ...]
    """Orders that stood out of the noise, so were taken away."""


def deband(unwrapped_phase: AnyArray, *, significance: float = 3.0, passes: int = 2) -> Debanded:
    """Take the repeating error out of ``unwrapped_phase`` (y, x) in radians, NaN where not measured.

    Only orders whose ripple is ``significance`` standard deviations are touched.
    """
    corrected = np.array(unwrapped_phase, dtype=np.result_type(unwrapped_phase, np.float32))
    before = measure_banding(corrected)
    if before is None:
        return Debanded(corrected, np.zeros(ORDERS), np.zeros(ORDERS), np.zeros(ORDERS), ())
    banding, removed = before, np.zeros(ORDERS, dtype=bool)
    for _ in range(passes):
        standing_out = banding.ripple > significance * banding.ripple_std
        if not standing_out.any():
            break
        removed |= standing_out
        kept = banding._replace(coefficients=banding.coefficients * standing_out[:, None])
        for first in range(0, len(corrected), _ROWS):
            corrected[first : first + _ROWS] -= banding_error(corrected[first : first + _ROWS], kept)
        again = measure_banding(corrected)
        if again is None:
            break
        banding = again
    return Debanded(
        corrected, before.ripple, banding.ripple, before.ripple_std, tuple(int(k) + 1 for k in np.nonzero(removed)[0])
    )


def banding_error(unwrapped_phase: AnyArray, banding: Banding) -> FloatArray:
    """The error e(Φ) at each phase, rad."""
    unwrapped_phase = np.asarray(unwrapped_phase, dtype=np.float64)
    place = (unwrapped_phase - banding.middle) / banding.half_range
    turn = np.exp(1j * unwrapped_phase)
    power = np.ones_like(turn)
    error = np.zeros(unwrapped_phase.shape)
    for cosine, cosine_change, sine, sine_change in banding.coefficients:
        power = power * turn
        if cosine or sine or cosine_change or sine_change:
            error += (cosine + cosine_change * place) * power.real + (sine + sine_change * place) * power.imag
    return error


def measure_banding(unwrapped_phase: AnyArray) -> Banding | None:
    """Fit the repeating error; ``None`` where less than two periods, or too narrow a field, are measured."""
    grid = _projector_grid(unwrapped_phase)
    if grid is None:
        return None
    relief, phase = grid
    seen = np.isfinite(relief)
    cover = _window(seen.astype(np.float64))
    usable = seen & (cover > _MIN_COVER)
    if usable.sum() < _MIN_CELLS:
        return None

    def above_window(values: FloatArray) -> FloatArray:
        """The cells of ``values`` (block, bin) minus the mean of the cells seen in their window."""
        smooth = _window(np.where(seen, values, 0.0)) / np.maximum(cover, _MIN_COVER)
        return (values - smooth)[usable]

    low, high = (float(v) for v in np.nanpercentile(unwrapped_phase, [1, 99]))
    middle, half_range = 0.5 * (low + high), max(0.5 * (high - low), np.pi)
    place = (phase - middle) / half_range
    regressors = np.empty((int(usable.sum()), 4 * ORDERS))
    for k in range(1, ORDERS + 1):
        blur = np.sinc(k / _BINS)  # a bin's mean of an order is a little smaller than the order
        for column, wave in enumerate((np.cos(k * phase), np.sin(k * phase))):
            regressors[:, 4 * (k - 1) + 2 * column] = above_window(np.broadcast_to(blur * wave, relief.shape))
            changing = np.broadcast_to(blur * wave * place, relief.shape)
            regressors[:, 4 * (k - 1) + 2 * column + 1] = above_window(changing)
    values = above_window(relief)
    block, row = np.nonzero(usable)
    strip = (block * _STRIPS) // relief.shape[0]
    zone = (np.searchsorted(np.sort(row), row) * _ZONES) // row.size
    if len(np.unique(strip)) < _LEAST_STRIPS:
        return None
    weight: FloatArray = np.ones(values.size)
    solution: FloatArray = np.zeros(4 * ORDERS)
    for _ in range(4):
        normal, right = _by_part(regressors, values, weight, strip)
        solution = _solve(normal.sum(axis=0), right.sum(axis=0))
        residual = values - regressors @ solution
        limit = 4.7 * 1.4826 * float(np.median(np.abs(residual))) + 1e-9
        agreeing = np.clip(1.0 - (residual / limit) ** 2, 0.0, None) ** 2
        weight = np.asarray(agreeing / _local_power(residual, usable), dtype=np.float64)
    variance = np.maximum(
        _left_out_variance(normal, right), _left_out_variance(*_by_part(regressors, values, weight, zone))
    )
    share = np.array([1.0, float(np.mean(place[row] ** 2))])  # mean square of 1 and of the place over the field
    power = _power(solution**2, share)
    noise = _power(variance, share)
    return Banding(solution.reshape(ORDERS, 4), middle, half_range, np.sqrt(power), np.sqrt(noise))


def _power(squares: FloatArray, share: FloatArray) -> FloatArray:
    power: FloatArray = (squares.reshape(ORDERS, 2, 2) * share).sum(axis=(1, 2))
    return power


def _projector_grid(unwrapped_phase: AnyArray) -> tuple[FloatArray, FloatArray] | None:
    """Phase minus a smooth surface, mean of each cell (column block, phase bin), and the bins' phases (bin,)."""
    known = np.isfinite(unwrapped_phase)
    measured = int(known.sum())
    if measured < _MIN_CELLS:
        return None
    height, width = unwrapped_phase.shape
    sample = np.divmod(np.flatnonzero(known)[:: max(1, measured // 20000)], width)
    smooth = np.linalg.lstsq(_polynomial(*sample, known.shape), unwrapped_phase[sample].astype(float), rcond=None)[0]
    width_bin = 2.0 * np.pi / _BINS
    first = int(np.floor(float(np.nanmin(unwrapped_phase)) / width_bin))
    bins = int(np.floor(float(np.nanmax(unwrapped_phase)) / width_bin)) - first + 1
    blocks = (width + _BLOCK_PX - 1) // _BLOCK_PX
    if not 2 * _BINS < bins < 200_000:
        return None
    count, total = np.zeros(blocks * bins), np.zeros(blocks * bins)
    for row in range(0, height, _ROWS):
        y, x = np.nonzero(known[row : row + _ROWS])
        value = unwrapped_phase[row + y, x].astype(float)
        relief = value - _polynomial(row + y, x, known.shape) @ smooth
        cell = (x // _BLOCK_PX) * bins + np.floor(value / width_bin).astype(np.int64) - first
        count += np.bincount(cell, minlength=blocks * bins)
        total += np.bincount(cell, weights=relief, minlength=blocks * bins)
    mean: FloatArray = np.full(blocks * bins, np.nan, dtype=np.float64)
    np.divide(total, count, out=mean, where=count > 0)
    phase: FloatArray = (first + np.arange(bins) + 0.5) * width_bin
    return mean.reshape(blocks, bins), phase


def _polynomial(row: AnyArray, column: AnyArray, shape: tuple[int, ...]) -> FloatArray:
    x, y = 2.0 * column / shape[1] - 1.0, 2.0 * row / shape[0] - 1.0
    x2, y2, xy = x * x, y * y, x * y
    return np.stack([np.ones_like(x), x, y, x2, xy, y2, x2 * x, x2 * y, x * y2, y2 * y]).T


def _window(rows: FloatArray) -> FloatArray:
    """Triangular window of two periods along the last axis (a running mean over one period, twice); nothing beyond."""
    size = rows.shape[-1]
    padded = np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(_BINS, _BINS)])
    total = np.cumsum(padded, axis=-1)
    once = total[..., _BINS:] - total[..., :-_BINS]
    total = np.cumsum(np.pad(once, [(0, 0)] * (rows.ndim - 1) + [(1, _BINS)]), axis=-1)
    twice = (total[..., _BINS:] - total[..., :-_BINS]) / _BINS**2
    window: FloatArray = twice[..., :size]
    return window


def _local_power(residual: FloatArray, usable: BoolArray) -> FloatArray:
    """Mean square of the residuals around each usable cell, of their overall one: much where the relief is lively."""
    squares = np.zeros(usable.shape)
    squares[usable] = residual**2
    side = (2 * _BINS + 1, 17)
    power = cv2.boxFilter(squares, -1, side) / np.maximum(cv2.boxFilter(usable.astype(np.float64), -1, side), 1e-9)
    local: FloatArray = power[usable]
    local = local + 0.05 * float(np.mean(local)) + 1e-18
    return local


def _by_part(
    regressors: FloatArray, values: FloatArray, weight: FloatArray, part: AnyArray
) -> tuple[FloatArray, FloatArray]:
    """Normal matrices (part, p, p) and right sides (part, p) of the cells of each part of the field."""
    normal, right = [], []
    for number in np.unique(part):
        here = part == number
        weighted = regressors[here] * weight[here, None]
        normal.append(weighted.T @ regressors[here])
        right.append(weighted.T @ values[here])
    return np.array(normal), np.array(right)


def _left_out_variance(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Variance (p,) of the solution, from leaving out one part after the other (jackknife)."""
    whole, whole_right = normal.sum(axis=0), right.sum(axis=0)
    left_out = np.array([_solve(whole - n, whole_right - r) for n, r in zip(normal, right, strict=True)])
    spread: FloatArray = left_out - left_out.mean(axis=0)
    variance: FloatArray = (len(normal) - 1) / len(normal) * np.sum(spread**2, axis=0)
    return variance


def _solve(normal: FloatArray, right: FloatArray) -> FloatArray:
    damping = 1e-6 * np.trace(normal) / len(normal) * np.eye(len(normal))
    solution: FloatArray = np.linalg.solve(normal + damping, right)
    return solution
