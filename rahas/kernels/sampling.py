"""Pixels chosen to stand for the field, and smooth guesses where nothing is known."""

from __future__ import annotations

import numpy as np

from rahas.typing import AnyArray, BoolArray, Float32Array

_ROWS = 32  # filled at a time: a pixel's polynomial terms take twenty times the pixel


def evenly_spread(mask: BoolArray, count: int) -> tuple[AnyArray, AnyArray]:
    """About ``count`` pixels of ``mask`` spread evenly over it, always the same ones: (rows, columns)."""
    rows, columns = np.nonzero(mask)
    if len(rows) > count:
        # a fixed stride through the raster, co-prime with the width by jitter of the golden ratio
        position = (np.arange(count) * (len(rows) / count) + 0.618 * (len(rows) / count)).astype(int)
        chosen = np.minimum(position, len(rows) - 1)
        rows, columns = rows[chosen], columns[chosen]
    return rows, columns


def with_smooth_guess(values: AnyArray, known: BoolArray, *, degree: int = 3) -> Float32Array:
    """``values`` where ``known``, elsewhere a polynomial in x and y fitted to them. (y, x) arrays."""
    height, width = values.shape
    rows, columns = evenly_spread(known, 4000)

    def terms(r: AnyArray, c: AnyArray) -> AnyArray:
        v, u = 2.0 * r / max(1, height - 1) - 1.0, 2.0 * c / max(1, width - 1) - 1.0
        return np.stack([u**i * v**j for i in range(degree + 1) for j in range(degree + 1 - i)], axis=-1)

    fit = np.linalg.lstsq(terms(rows, columns), values[rows, columns], rcond=None)[0]
    low, high = values[known].min(), values[known].max()
    filled = np.array(values, dtype=np.float32)
    for first in range(0, height, _ROWS):
        part = slice(first, first + _ROWS)
        y, x = np.mgrid[first : min(first + _ROWS, height), 0:width]
        guess = np.clip(terms(y, x) @ fit, low - np.pi, high + np.pi)
        np.copyto(filled[part], guess, where=~known[part], casting="same_kind")
    return filled
