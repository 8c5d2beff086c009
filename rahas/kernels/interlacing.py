"""Interlaced video: two fields a frame, half a frame apart in time, on alternate rows.

| name | symbol | definition |
|---|---|---|
| top field | T | rows 0, 2, 4, … |
| bottom field | B | rows 1, 3, 5, … |
| first field | | the one exposed first: the top one when ``top_first``, the bottom one when ``bottom_first`` |
| within | d(Tₙ, Bₙ) | mean squared difference of the two fields of a frame |
| top step | d(Bₙ, Tₙ₊₁) | half a frame apart if the top field is first, one and a half if not, one if progressive |
| bottom step | d(Tₙ, Bₙ₊₁) | the other way round |

T is brought to the rows of B by linear interpolation, so noise and interpolation add the same to all three distances
and cancel in their differences.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import AnyArray, FloatArray

PROGRESSIVE, TOP_FIRST, BOTTOM_FIRST = "progressive", "top_first", "bottom_first"

_COLUMN_STEP = 8
_SIGNIFICANT_SHARE = 0.2
_SIGNIFICANT_VARIANCE = 1.0
_FRAMES_NEEDED = 5


class FieldDistances(NamedTuple):
    """Mean squared differences between neighbouring fields, grey levels squared, (frame - 1)."""

    within: FloatArray
    top_step: FloatArray
    bottom_step: FloatArray


class Interlacing(NamedTuple):
    """What a capture is, and where that is known from."""

    field_order: str
    """``progressive``, ``top_first`` or ``bottom_first``."""
    lean: float | None
    """+1 for top field first, 0 for progressive, -1 for bottom field first; None where nothing moved."""

    @property
    def interlaced(self) -> bool:
        return self.field_order != PROGRESSIVE


def fields(interlaced: bool, field_order: str) -> list[slice]:
    """Rows of the moments of a frame, in the order of time: one slice if progressive, two if interlaced."""
    if not interlaced:
        return [slice(None)]
    top, bottom = slice(0, None, 2), slice(1, None, 2)
    return [bottom, top] if field_order == BOTTOM_FIRST else [top, bottom]


def first_field_full_height(frames: AnyArray, field_order: str = TOP_FIRST) -> AnyArray:
    """The first field of frames (frame, y, x), or of one frame (y, x), linearly interpolated to full height.

    The field's own rows are kept as they are; rows between are the mean of their neighbours (integers: rounded), a
    row outside repeats the nearest. The dtype stays. Progressive frames are returned as they are.
    """
    if field_order == PROGRESSIVE:
        return frames
    first = 1 if field_order == BOTTOM_FIRST else 0
    own = frames[..., first::2, :]
    between = _mean_of_neighbours(own)
    full = np.empty_like(frames)
    full[..., first::2, :] = own
    full[..., first + 1 : first + 2 * between.shape[-2] : 2, :] = between
    if first:
        full[..., 0, :] = own[..., 0, :]
    if (full.shape[-2] - first) % 2 == 0:
        full[..., -1, :] = own[..., -1, :]
    return full


def field_distances(before: AnyArray, after: AnyArray) -> tuple[float, float, float]:
    """(within, top step, bottom step) of two frames (y, x) that follow each other, on every eighth column."""
    rows = before.shape[0] // 2 * 2
    old, new = (frame[:rows, ::_COLUMN_STEP].astype(np.float32) for frame in (before, after))
    old_top, new_top = (0.5 * (frame[0:-2:2] + frame[2::2]) for frame in (old, new))  # at the rows 1, 3, …
    old_bottom, new_bottom = old[1:-1:2], new[1:-1:2]
    return (
        0.5 * (_mean_square(old_top, old_bottom) + _mean_square(new_top, new_bottom)),
        _mean_square(old_bottom, new_top),
        _mean_square(old_top, new_bottom),
    )


def recognise_interlacing(distances: FieldDistances, flagged_order: str) -> Interlacing:
    """Decide by the content where something moves, else by the flags of the stream (``flagged_order``).

    Where the picture moves by m a frame the distances go as (m/2)², (m/2)², (3m/2)² for interlaced and 0, m², m² for
    progressive video, so lean = (bottom step − top step) / (|bottom step − within| + |top step − within|) is ±1 or 0.
    The median over the moving frames stands lamp switches and bumps. Film in fields (2:3) counts as progressive.
    """
    top_motion = distances.top_step - distances.within
    bottom_motion = distances.bottom_step - distances.within
    motion = np.abs(top_motion) + np.abs(bottom_motion)
    moving = motion > _SIGNIFICANT_SHARE * distances.within + _SIGNIFICANT_VARIANCE
    if np.count_nonzero(moving) < _FRAMES_NEEDED:
        return Interlacing(flagged_order, None)
    lean = float(np.median((bottom_motion - top_motion)[moving] / motion[moving]))
    if lean > 0.5:
        return Interlacing(TOP_FIRST, lean)
    if lean < -0.5:
        return Interlacing(BOTTOM_FIRST, lean)
    return Interlacing(PROGRESSIVE, lean)


def _mean_of_neighbours(rows: AnyArray) -> AnyArray:
    above, below = rows[..., :-1, :], rows[..., 1:, :]
    if np.issubdtype(rows.dtype, np.integer):
        wide = above.astype(np.uint32)
        return ((wide + below + 1) >> 1).astype(rows.dtype)
    return (0.5 * (above + below)).astype(rows.dtype)


def _mean_square(one: AnyArray, other: AnyArray) -> float:
    return float(cv2.norm(one, other, cv2.NORM_L2SQR)) / one.size
