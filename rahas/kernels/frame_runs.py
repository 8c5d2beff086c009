"""Runs of frames, and where a slow motion leaves its stop."""

from __future__ import annotations

import numpy as np

from rahas.typing import BoolArray, FloatArray


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """First and last index (inclusive) of every run of true values.

    >>> runs(np.array([False, True, True, False, True]))
    [(1, 2), (4, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def running_median(values: FloatArray, width: int) -> FloatArray:
    """Median over ``width`` (odd) frames: keeps every monotone motion as it is, removes shorter swings."""
    half = width // 2
    if half == 0 or len(values) == 0:
        return np.asarray(values, np.float64).copy()
    padded = np.pad(values, half, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)


def first_beyond(deviation: FloatArray, limit: float) -> int:
    """Index of the first frame whose ``deviation`` exceeds ``limit`` in size; the length where none does."""
    beyond = np.flatnonzero(np.abs(deviation) > limit)
    return int(beyond[0]) if beyond.size else len(deviation)


def last_beyond(deviation: FloatArray, limit: float) -> int:
    """Index of the last frame whose ``deviation`` exceeds ``limit`` in size; −1 where none does."""
    beyond = np.flatnonzero(np.abs(deviation) > limit)
    return int(beyond[-1]) if beyond.size else -1
