"""Pattern phase at epipolar alignment, as a polynomial over the image, from the first hold alone.

| name | symbol | definition |
|---|---|---|
| pattern | s0 | (I − a)/b of the first hold, cos Φ0 where lit, 0 elsewhere (y, x) |
| first phase | Φ0 | phase at the first stop, in turns (1 = a stripe), smooth whatever the surface (thesis B.1) |
| x̂, ŷ | | image coordinates brought to −1 … 1 |

No unwrapping: gaps between lit pieces have no phase to follow. The local wave number of each cell is a lag product,
free of any integer; the polynomial whose gradient they are carries over gaps, and what is left of the phase is below
half a turn and is fitted in turn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rahas.kernels.carrier import carrier_from_stripes
from rahas.typing import AnyArray, Float32Array, FloatArray

DEGREE = 3
EXPONENTS = tuple((i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i))
"""Powers of x̂ and ŷ of the polynomial's terms; the first is the constant."""
_CELLS = (16, 24)
_LAG_SHARE = 0.25  # of the stripe pitch
_ROUNDS = (1, 1, 2, DEGREE, DEGREE)
_RIDGE = 1e-4

_ROWS = 128  # of the model made at a time

ComplexArray = NDArray[np.complexfloating[Any]]


def polynomial_terms(rows: AnyArray, columns: AnyArray, shape: tuple[int, int]) -> FloatArray:
    """Terms x̂ⁱŷʲ (term, …) at pixels ``rows``, ``columns`` of an image of this shape (y, x)."""
    x, y = _scaled(columns, shape[1]), _scaled(rows, shape[0])
    return np.stack([x**i * y**j for i, j in EXPONENTS])


def first_phase_of_hold(pattern: Float32Array, *, sense: int) -> FloatArray:
    """Coefficients (term) of Φ0 in turns; its integer is arbitrary.

    Parameters
    ----------
    pattern
        (y, x) s0, 0 where nothing is lit.
    sense
        +1: Φ0 grows with x; −1: it falls (``rotation_sense`` of the timeline).

    Raises
    ------
    ValueError
        The hold shows no stripes that run down the image.
    """
    if not np.any(pattern):
        raise ValueError("the first hold shows no lit pixel")
    carrier = carrier_from_stripes(pattern, axis=1)
    if carrier.wave_number <= 0:
        raise ValueError(f"no stripes along x in the first hold: {carrier.wave_number = :.3g}")
    # along y the carrier hardly turns: a short mean takes out noise and what lies above the stripes' frequency
    lag = max(1, round(_LAG_SHARE * 2 * np.pi / carrier.wave_number))
    signal = carrier.signal.astype(np.complex64)
    del carrier
    signal *= pattern != 0
    fit = _from_gradients(signal, lag)
    for degree in _ROUNDS:
        fit = fit + _of_residual(_less_model(signal, fit), degree)
    return fit * sense


def _less_model(signal: ComplexArray, fit: FloatArray) -> ComplexArray:
    """The signal (y, x) with the polynomial's phase taken off."""
    height, width = signal.shape
    powers = np.arange(DEGREE + 1)[:, None]
    table = np.zeros((DEGREE + 1, DEGREE + 1))
    for (i, j), coefficient in zip(EXPONENTS, fit, strict=True):
        table[j, i] = coefficient
    by_x = table @ _scaled(np.arange(width), width) ** powers
    y = _scaled(np.arange(height), height) ** powers
    left = np.empty_like(signal)
    for first in range(0, height, _ROWS):
        part = slice(first, first + _ROWS)
        left[part] = signal[part] * np.exp(-2j * np.pi * (y[:, part].T @ by_x))
    return left


def _from_gradients(signal: ComplexArray, lag: int) -> FloatArray:
    """Polynomial without constant whose gradient is the local wave number, weighted by power."""
    height, width = signal.shape
    normal, right = _RIDGE * np.eye(len(EXPONENTS)), np.zeros(len(EXPONENTS))
    for axis in (1, 0):
        along = np.moveaxis(signal, axis, 0)
        sums, at_y, at_x = _cell_sums(np.moveaxis(along[lag:] * along[:-lag].conj(), 0, axis))
        weight = np.abs(sums).ravel()
        weight = weight / max(float(weight.sum()), 1e-12)
        size = width if axis == 1 else height
        step = 2.0 * lag / max(1, size - 1)  # of the scaled coordinate
        x, y = _scaled(at_x, width), _scaled(at_y, height)
        if axis == 1:
            terms = np.stack([(x + step) ** i * y**j - x**i * y**j for i, j in EXPONENTS])
        else:
            terms = np.stack([x**i * (y + step) ** j - x**i * y**j for i, j in EXPONENTS])
        terms /= step
        turns = np.angle(sums).ravel() / (2 * np.pi * step)
        normal += (terms * weight) @ terms.T
        right += (terms * weight) @ turns
    return np.asarray(np.linalg.solve(normal, right))


def _of_residual(residual: ComplexArray, degree: int) -> FloatArray:
    """Polynomial of at most this degree through a phase that is left below half a turn."""
    sums, at_y, at_x = _cell_sums(residual)
    whole = np.angle(sums.sum())
    turns = np.angle(sums * np.exp(-1j * whole)).ravel() / (2 * np.pi)
    weight = np.abs(sums).ravel()
    weight = weight / max(float(weight.sum()), 1e-12)
    kept = np.array([i + j <= degree for i, j in EXPONENTS])
    terms = polynomial_terms(at_y, at_x, residual.shape)[kept]
    found = np.zeros(len(EXPONENTS))
    found[kept] = np.linalg.solve((terms * weight) @ terms.T + _RIDGE * np.eye(kept.sum()), (terms * weight) @ turns)
    found[0] += whole / (2 * np.pi)
    return found


def _cell_sums(field: ComplexArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Sums over the cells of a grid, and rows and columns of the cells' centroids by power (cell)."""
    edges = [np.linspace(0, n, min(c, n) + 1).astype(int)[:-1] for n, c in zip(field.shape, _CELLS, strict=True)]

    def over_cells(values: AnyArray) -> AnyArray:
        return np.asarray(np.add.reduceat(np.add.reduceat(values, edges[0], axis=0), edges[1], axis=1))

    power = np.abs(field)
    power += power.dtype.type(1e-12)
    total = over_cells(power)
    at_y = over_cells(power * np.arange(field.shape[0], dtype=power.dtype)[:, None]) / total
    at_x = over_cells(power * np.arange(field.shape[1], dtype=power.dtype)) / total
    return over_cells(field), at_y.ravel(), at_x.ravel()


def _scaled(index: AnyArray, size: int) -> FloatArray:
    return np.asarray(2.0 * np.asarray(index, np.float64) / max(1, size - 1) - 1.0)
