"""Frames that repeat the one before, and frames that are missing, told from the smoothness of a hand's motion.

A hand cannot stop and go on within a few frames at full speed: a frame in which the pattern stands still while its
neighbours move is a repeat, and a step of twice its neighbours' size spans a lost frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.frame_runs import runs
from rahas.typing import BoolArray, FloatArray

LONGEST_REPEAT = 3
NEIGHBOURS = 4


class DroppedFrames(NamedTuple):
    """Frames missing from the record."""

    after: int
    """Frame after which they are missing."""
    count: int  # type: ignore[assignment]  # the name that timeline.json has
    """How many, as far as the neighbours' pace tells."""


def repeated_frames(change_rms: FloatArray, *, noise: float, moving: BoolArray) -> list[int]:
    """Frames that repeat the one before while the pattern moves.

    Parameters
    ----------
    change_rms
        (frame) rms difference from the frame before.
    noise
        Standard deviation of one pixel in one frame.
    moving
        (frame) inside the rotation or the scan.
    """
    moved = np.sqrt(np.clip(change_rms**2 - 2 * noise**2, 0, None))
    pace = _median_of_neighbours(moved, NEIGHBOURS + LONGEST_REPEAT)
    still = moving & (moved < 0.25 * pace) & (pace > 1.5 * noise)
    found: list[int] = []
    for first, last in runs(still):
        if last - first + 1 > LONGEST_REPEAT or first == 0 or last + 1 == len(moved):
            continue
        if min(moved[first - 1] / pace[first - 1], moved[last + 1] / pace[last + 1]) > 0.6:
            found += range(first, last + 1)
    return found


def identical_frames(change_rms: FloatArray) -> list[int]:
    """Frames equal to the one before to the last bit, where frames with noise of their own cannot be."""
    usual = float(np.median(change_rms[1:])) if len(change_rms) > 1 else 0.0
    return [int(n) for n in np.flatnonzero(change_rms[1:] == 0) + 1] if usual > 0 else []


def lost_frames(travel: FloatArray, *, noise: float, repeated: list[int]) -> list[DroppedFrames]:
    """Frames lost where the slide's angle or the pattern's step, ``travel`` (frame), makes too large a step.

    ``noise`` is the uncertainty of one step of ``travel``; NaN frames are outside the motion.
    """
    pace = np.diff(travel)
    usable = np.isfinite(pace)
    usable[[n - 1 for n in repeated if 0 < n <= len(pace)]] = False
    found = []
    known = np.flatnonzero(usable)
    for place, n in enumerate(known):
        before, after = known[max(0, place - NEIGHBOURS) : place], known[place + 1 : place + 1 + NEIGHBOURS]
        near = pace[np.concatenate([before[n - before < 12], after[after - n < 12]])]
        if min(len(before), len(after)) < 2 or not len(near):
            continue
        usual = float(np.median(near))
        if abs(usual) < 8 * noise or np.abs(near / usual - 1).max() > 0.35:
            continue
        ratio = float(pace[n] / usual)
        if ratio > 1.65:
            found.append(DroppedFrames(int(n), round(ratio) - 1))
    return found


def gaps_in_time(time_s: FloatArray) -> list[DroppedFrames]:
    """Frames lost according to the presentation times: gaps of 1.6 frame periods and more."""
    if len(time_s) < 3:
        return []
    between = np.diff(time_s)
    period = float(np.median(between))
    if not period > 0:
        return []
    return [DroppedFrames(int(n), round(between[n] / period) - 1) for n in np.flatnonzero(between > 1.6 * period)]


def _median_of_neighbours(values: FloatArray, reach: int) -> FloatArray:
    padded = np.pad(values, reach, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.median(np.delete(windows, reach, axis=1), axis=1)
