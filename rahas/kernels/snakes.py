"""The snake matrix set of a frame (thesis 3.4.2 and glossary), and peaks with names as they become snakes.

Si ``identity`` (snake, x): number of the stripe that runs through column x on the canvas, 0 where blank;
1 is the topmost stripe of the first frame.  Sy ``y``: its row on the canvas.  Sp ``value``: the pixel value there.
A peak of the snake mask is *valid*; it is *active* once it has an identity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.peaks import Peaks
from rahas.kernels.unrotation import image_matrix
from rahas.typing import AnyArray, Float32Array


class SnakeSet(NamedTuple):
    """{Si, Sy, Sp} of one frame; row k − 1 holds snake k."""

    identity: AnyArray
    """(snake, x) int16 Si."""
    y: Float32Array
    """(snake, x) Sy, canvas pixels, NaN where blank."""
    value: Float32Array
    """(snake, x) Sp, grey levels of the balanced, smoothed frame, NaN where blank."""


def blank_snakes(snakes: int, width: int) -> SnakeSet:
    """A snake matrix set without any active pixel."""
    blank = np.full((snakes, width), np.nan, np.float32)
    return SnakeSet(np.zeros((snakes, width), np.int16), blank, blank.copy())


def rows_from_names(peaks: Peaks, names: AnyArray, snakes: int) -> Float32Array:
    """Sy (snake, x) of peaks named 1…``snakes``; ``names`` (x, slot) int16, 0 for a peak without a name."""
    y = np.full((snakes, peaks.counts.size), np.nan, np.float32)
    x, slot = np.nonzero(names > 0)
    y[names[x, slot] - 1, x] = peaks.y[x, slot]
    return y


def snake_set_from_rows(y: Float32Array, frame: Float32Array, unrotation_deg: float) -> SnakeSet:
    """The snake matrix set of rows ``y`` (snake, x); values are looked up in the smoothed ``frame``, not un-rotated."""
    height, width = frame.shape
    snake, x = np.nonzero(np.isfinite(y))
    matrix = image_matrix(unrotation_deg, height=height, width=width)
    row = y[snake, x]
    column = np.rint(matrix[0, 0] * x + matrix[0, 1] * row + matrix[0, 2]).astype(np.int64)
    line = np.rint(matrix[1, 0] * x + matrix[1, 1] * row + matrix[1, 2]).astype(np.int64)
    identity = np.zeros(y.shape, np.int16)
    identity[snake, x] = snake + 1
    value = np.full(y.shape, np.nan, np.float32)
    value[snake, x] = frame[np.clip(line, 0, height - 1), np.clip(column, 0, width - 1)]
    return SnakeSet(identity, y, value)
