"""Following snakes from frame to frame (thesis 3.4.4): ``SnakeFind_multiPassTrackDeltaY``.

Each active pixel of the frame before looks up and down its column for the nearest valid pixel (equation 3.10); a valid
pixel belongs to the snake that takes it first. This is done from the topmost snake down and from the lowest up, and
only what both passes agree on is kept (equation 3.11). Beyond the thesis, the pixels look about where the whole pattern
has moved to, a plane fitted to a first, wider search: an un-rotation a few degrees off, or a lever that jumps, moves
all stripes alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.kernels.peaks import Peaks
from rahas.typing import AnyArray, Float32Array, FloatArray

_MIN_MATCHES = 40
_COLUMN_STEP = 4
"""The common motion is sought on every fourth column."""
MEMORY_FRAMES = 3
"""Frames for which a pixel that was lost is still looked for."""
_SEEN_SHARE = 0.5
"""A frame that shows less than this share of the snakes is a bad one: what was known before it stays known."""


class Motion(NamedTuple):
    """Displacement of the stripes since the frame before: dy = offset + per_x·x + per_y·y, pixels."""

    offset: float
    per_x: float
    per_y: float


STILL = Motion(0.0, 0.0, 0.0)


class Memory(NamedTuple):
    """Where snakes were seen last."""

    y: Float32Array
    """(snake, x) rows, NaN where not seen for ``MEMORY_FRAMES``."""
    age: AnyArray
    """(snake, x) uint8 frames since then."""


def memory_of_rows(y: Float32Array) -> Memory:
    """Memory of a frame's snakes (snake, x)."""
    return Memory(y.copy(), np.zeros(y.shape, np.uint8))


def remembered(memory: Memory, y: Float32Array, motion: Motion) -> Memory:
    """Memory after a frame with snakes at ``y``, the pixels that it lost moved along with the others."""
    seen = np.isfinite(y)
    known = np.isfinite(memory.y)
    if np.count_nonzero(seen) < _SEEN_SHARE * np.count_nonzero(known & (memory.age == 0)):
        return memory
    x = np.arange(y.shape[1], dtype=np.float32)
    moved = memory.y * np.float32(1 + motion.per_y) + (np.float32(motion.offset) + np.float32(motion.per_x) * x)
    age = np.where(seen, 0, np.minimum(memory.age, MEMORY_FRAMES) + 1).astype(np.uint8)
    return Memory(np.where(seen, y, np.where(age <= MEMORY_FRAMES, moved, np.nan)).astype(np.float32), age)


def track_snakes(before: Float32Array, peaks: Peaks, *, wide_px: float, narrow_px: float) -> tuple[AnyArray, Motion]:
    """Names of this frame's peaks (x, slot) by the snakes (snake, x) of the frame ``before``, and how they moved.

    ``wide_px`` is the reach of the first search, which finds the common motion, ``narrow_px`` that of the second.
    """
    found = multi_pass_track_delta_y(before, peaks, STILL, reach_px=wide_px, column_step=_COLUMN_STEP)
    motion = motion_of_snakes(before, peaks, found)
    return multi_pass_track_delta_y(before, peaks, motion, reach_px=narrow_px), motion


def multi_pass_track_delta_y(
    before: Float32Array, peaks: Peaks, motion: Motion, *, reach_px: float, column_step: int = 1
) -> AnyArray:
    """``SnakeFind_multiPassTrackDeltaY``: int16 names (x, slot) that the top-down and the bottom-up pass agree on."""
    down = np.zeros(peaks.y.shape, np.int16)
    up = np.zeros(peaks.y.shape, np.int16)
    _track_delta_y(before, peaks.y, peaks.counts, *motion, reach_px, column_step, True, down)
    _track_delta_y(before, peaks.y, peaks.counts, *motion, reach_px, column_step, False, up)
    agreed: AnyArray = np.where(down == up, down, 0).astype(np.int16)
    return agreed


def motion_of_snakes(before: Float32Array, peaks: Peaks, names: AnyArray) -> Motion:
    """Plane through the displacements of tracked pixels, robust against those that were taken wrongly."""
    x, slot = np.nonzero(names > 0)
    if x.size < _MIN_MATCHES:
        return STILL
    thin = slice(None, None, max(1, x.size // 1500))
    x, slot = x[thin], slot[thin]
    y = before[names[x, slot] - 1, x].astype(np.float64)
    shift = peaks.y[x, slot] - y
    terms = np.stack([np.ones(x.size), x - x.mean(), y - y.mean()])
    keep = np.ones(x.size, bool)
    plane: FloatArray = np.zeros(3)
    for _ in range(3):
        used = terms[:, keep]
        plane = np.linalg.solve(used @ used.T + np.diag([0.0, 1.0, 1.0]), used @ shift[keep])
        residual = np.abs(shift - plane @ terms)
        keep = residual <= max(3.0 * float(np.median(residual)), 0.5)
    offset = float(plane[0] - plane[1] * x.mean() - plane[2] * y.mean())
    return Motion(offset, float(plane[1]), float(plane[2]))


@numba.njit(cache=True, nogil=True)
def _track_delta_y(
    before: Float32Array,
    peak_y: Float32Array,
    count: AnyArray,
    offset: float,
    per_x: float,
    per_y: float,
    reach: float,
    column_step: int,
    top_down: bool,
    names: AnyArray,
) -> None:
    snakes, nx = before.shape
    for n in range(snakes):
        k = n if top_down else snakes - 1 - n
        for x in range(0, nx, column_step):
            y = before[k, x]
            if y != y:
                continue
            y += offset + per_x * x + per_y * y
            best = -1
            nearest = reach
            for i in range(count[x]):
                distance = abs(peak_y[x, i] - y)
                if distance <= nearest and names[x, i] == 0:
                    nearest = distance
                    best = i
            if best >= 0:
                names[x, best] = k + 1
