"""Fringe order from snakes (thesis 3.20–3.21): the snakes of a column bound its bands, and a band has one order.

Between two neighbouring snakes the phase is known coarsely, by interpolation; the order is the integer that brings the
wrapped phase nearest to it. The thesis's own rule, the order of the snake above, is kept with its blanked rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.typing import AnyArray, BoolArray, Float32Array

UNKNOWN_ORDER = np.int16(-32768)


class Orders(NamedTuple):
    """Fringe order of each pixel, and how far it can be trusted."""

    order: AnyArray  # (y, x) int16, −32768 where unknown
    confidence: Float32Array  # (y, x), 1 where wrapped and coarse phase agree, 0 where they differ by half a turn


def coarse_turns_from_snakes(
    identity: AnyArray, y: AnyArray, height: int, *, first_order: int, reach: float = 0.5
) -> Float32Array:
    """Coarse unwrapped phase in turns (Φ/2π) between the snakes of each column.

    Parameters
    ----------
    identity, y
        (snake, x): snake matrices at the reference slide position; identity 0 is blank.
    height
        Rows of the image.
    first_order
        Fringe order of the maximum that snake 1 lies on.
    reach
        How far the outermost snake of a run is trusted beyond itself, in stripes.

    Returns
    -------
    turns
        (height, x), NaN where no pair of neighbouring snakes encloses or reaches the pixel.
    """
    return _coarse_turns(identity.astype(np.int64), y.astype(np.float64), height, first_order, reach)


@numba.njit(cache=True)
def _coarse_turns(identity, y, height, first_order, reach):  # type: ignore[no-untyped-def]
    snakes, width = identity.shape
    turns = np.full((height, width), np.nan, dtype=np.float32)
    rows = np.empty(snakes)
    labels = np.empty(snakes)
    for x in range(width):
        count = 0
        for s in range(snakes):
            if identity[s, x] > 0:
                rows[count] = y[s, x]
                labels[count] = identity[s, x] - 1 + first_order
                count += 1
        for i in range(count - 1):
            if labels[i + 1] - labels[i] != 1 or rows[i + 1] <= rows[i]:
                continue
            pitch = rows[i + 1] - rows[i]
            begins = i == 0 or labels[i] - labels[i - 1] != 1
            ends = i == count - 2 or labels[i + 2] - labels[i + 1] != 1
            first = rows[i] - (reach * pitch if begins else 0.0)
            last = rows[i + 1] + (reach * pitch if ends else 0.0)
            for row in range(max(0, int(np.ceil(first))), min(height - 1, int(np.floor(last))) + 1):
                turns[row, x] = labels[i] + (row - rows[i]) / pitch
    return turns


def orders_from_coarse(wrapped: AnyArray, coarse_turns: AnyArray, measured: BoolArray) -> Orders:
    """Order = round((Φ_coarse − φ)/2π) where both are known. (y, x) arrays; φ in radians, Φ_coarse in turns."""
    difference = coarse_turns - wrapped / (2.0 * np.pi)
    known = measured & np.isfinite(difference)
    rounded = np.rint(np.where(known, difference, 0.0))
    order = np.where(known, rounded, UNKNOWN_ORDER).astype(np.int16)
    confidence = np.where(known, 1.0 - 2.0 * np.abs(difference - rounded), 0.0)
    return Orders(order, confidence.astype(np.float32))


def blank_near_snakes(order: AnyArray, identity: AnyArray, y: AnyArray, rows: int) -> AnyArray:
    """The thesis's blanked boundary: no order within ``rows`` rows of a snake (3.21). Returns a new (y, x) array."""
    blanked = order.copy()
    height = order.shape[0]
    row = np.arange(height)[:, None]
    for s in range(len(identity)):
        near = (np.abs(row - y[s][None, :]) < rows) & (identity[s] > 0)[None, :]
        blanked[near] = UNKNOWN_ORDER
    return blanked


def grow_orders(order: AnyArray, wrapped: AnyArray, measured: BoolArray, *, steps: int, tolerance: float) -> AnyArray:
    """Carry orders to measured neighbours whose phase continues smoothly, at most ``steps`` pixels far.

    A pixel takes the order that makes its phase continue a neighbour's; it stays unknown where its neighbours
    disagree or the phase jumps by more than ``tolerance`` radians, as it does at a depth step.
    """
    return _grow(order, wrapped.astype(np.float32, copy=False), measured, steps, tolerance)


@numba.njit(cache=True)
def _grow(order, wrapped, measured, steps, tolerance):  # type: ignore[no-untyped-def]
    height, width = order.shape
    unknown = -32768
    turn = 2.0 * np.pi
    grown = order.copy()
    for _ in range(steps):
        changed = 0
        former = grown.copy()
        for r in range(height):
            for c in range(width):
                if former[r, c] != unknown or not measured[r, c]:
                    continue
                found = unknown
                agree = True
                for k in range(4):
                    rr = r + (1 if k == 0 else -1 if k == 1 else 0)
                    cc = c + (1 if k == 2 else -1 if k == 3 else 0)
                    if rr < 0 or rr >= height or cc < 0 or cc >= width or former[rr, cc] == unknown:
                        continue
                    there = wrapped[rr, cc] + turn * former[rr, cc]
                    candidate = int(np.rint((there - wrapped[r, c]) / turn))
                    if abs(wrapped[r, c] + turn * candidate - there) > tolerance:
                        continue
                    if found == unknown:
                        found = candidate
                    elif found != candidate:
                        agree = False
                if found != unknown and agree:
                    grown[r, c] = found
                    changed += 1
        if changed == 0:
            break
    return grown
