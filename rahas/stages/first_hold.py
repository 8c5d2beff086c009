"""The first hold: what the slide at its first stop shows, and the phase that it names there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.first_hold_phase import first_phase_of_hold, polynomial_terms
from rahas.kernels.hold_fit import HoldPixels, cells_of
from rahas.stages.rotation_frames import SIGNAL_LIMIT, TURN, Rotation
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

MOST_FRAMES = 16
_LEFT_OUT = (0.15, 0.35)  # of the hold, before and after: the lamp warms up, the lever starts to move
_STILL = 1.5  # a frame that differs from the hold's median so many times as much as the median frame is left out


class FirstHold(NamedTuple):
    """The still image at the first stop."""

    level: Float32Array
    """(y, x) grey levels, mean of still frames."""
    sense: int
    """+1: Φ0 grows with x; −1: it falls."""


def first_hold_of(frames: FrameStack, rotation: Rotation) -> FirstHold | None:
    """Mean of the still frames of the first hold; ``None`` where the capture has no such hold."""
    first, last = rotation.first_hold
    if last >= rotation.first:
        return None
    count = last - first + 1
    begin, end = first + int(_LEFT_OUT[0] * count), last + 1 - int(np.ceil(_LEFT_OUT[1] * count))
    end = max(end, begin + 1)
    shots = np.asarray(frames[max(begin, end - MOST_FRAMES) : end])
    if len(shots) > 2:
        some = shots[:, ::4, ::4].astype(np.float32)
        off = np.abs(some - np.median(some, axis=0)).mean(axis=(1, 2))
        shots = shots[off <= _STILL * np.median(off) + 1e-6]
    return FirstHold(shots.mean(axis=0, dtype=np.float32), rotation.sense)


def demodulated_phase(hold: FirstHold, background: AnyArray, modulation: AnyArray, measured: BoolArray) -> FloatArray:
    """Φ0 (term) in radians over the image from the hold alone, its whole turns arbitrary; good to some hundredths.

    Raises
    ------
    ValueError
        The hold shows no stripes that run down the image.
    """
    gain = hold.level[measured].mean() / background[measured].mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        signal = np.clip((hold.level / gain - background) / modulation, -SIGNAL_LIMIT, SIGNAL_LIMIT)
    pattern = np.where(measured, signal, 0.0).astype(np.float32)
    return TURN * first_phase_of_hold(pattern, sense=hold.sense)


def demodulated_at(coefficients: FloatArray, pixels: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """That polynomial at ``pixels`` (n, 2), x and y."""
    return np.asarray(coefficients @ polynomial_terms(pixels[:, 1], pixels[:, 0], shape))


def hold_pixels(hold: FirstHold, background: AnyArray, modulation: AnyArray, pixels: FloatArray) -> HoldPixels:
    """The hold at ``pixels`` (n, 2), x and y, whole numbers."""
    column, row = np.rint(pixels).astype(np.int64).T

    def at(image: AnyArray) -> FloatArray:
        return np.asarray(image[row, column], dtype=np.float64)

    cell = cells_of(row, column, (hold.level.shape[0], hold.level.shape[1]))
    return HoldPixels(at(hold.level), at(background), at(modulation), cell)
