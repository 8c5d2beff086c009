"""Frames that repeat the one before, and frames that are missing, told from the smoothness of a hand's motion.

A hand cannot stop and go on within a few frames at full speed: a frame in which the pattern stands still while its
neighbours move is a repeat, and a step of twice its neighbours' size spans a lost frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.frame_runs import runs
from rahas.typing import FloatArray

LONGEST_REPEAT = 3
NEIGHBOURS = 4


class DroppedFrames(NamedTuple):
    """Frames missing from the record."""

    after: int
    """Frame after which they are missing."""
    count: int  # type: ignore[assignment]  # the name that timeline.json has
    """How many, as far as the neighbours' pace tells."""


def repeated_frames(change_rms: FloatArray, travel: FloatArray, *, noise: float) -> list[int]:
    """Frames that repeat the one before while the pattern moves.

    Parameters
    ----------
    change_rms
        (frame) rms difference from the frame before.
    travel
        (frame) slide angle or phase step, NaN outside the motion: it must stand still in a repeat and go on in the same
        direction after it (a flickering lamp changes frames too, and a motion that turns back stands still).
    noise
        Standard deviation of one pixel in one frame.
    """
    moved = np.sqrt(np.clip(change_rms**2 - 2 * noise**2, 0, None))
    pace = _median_of_neighbours(moved, NEIGHBOURS + LONGEST_REPEAT)
    still = np.isfinite(travel) & (moved < 0.25 * pace) & (pace > 1.5 * noise)
    found: list[int] = []
    for first, last in runs(still):
        if last - first + 1 > LONGEST_REPEAT or first < 2 or last + 1 == len(moved):
            continue
        before, within, after = (
            travel[b] - travel[a] for a, b in ((first - 2, first - 1), (first - 1, last), (last, last + 1))
        )
        goes_on = before * after > 0 and abs(within) < 0.3 * min(abs(before), abs(after))
        if goes_on and min(moved[first - 1] / pace[first - 1], moved[last + 1] / pace[last + 1]) > 0.6:
            found += range(first, last + 1)
    return found


def identical_frames(change_rms: FloatArray) -> list[int]:
    """Frames equal to the one before to the last bit, where frames with noise of their own cannot be."""
    usual = float(np.median(change_rms[1:])) if len(change_rms) > 1 else 0.0
    return [int(n) for n in np.flatnonzero(change_rms[1:] == 0) + 1] if usual > 0 else []


def lost_frames(travel: FloatArray, time_s: FloatArray, *, noise: float, repeated: list[int]) -> list[DroppedFrames]:
    """Frames lost without a gap in the presentation times: where the motion runs on at a multiple of its pace.

    Parameters
    ----------
    travel
        (frame) slide angle or phase step, NaN outside the motion.
    time_s
        (frame) presentation times.
    noise
        Standard deviation of one frame's ``travel``.
    repeated
        Frames that repeat the one before; their time counts for the step that follows.
    """
    shown = np.isfinite(travel)
    shown[repeated] = False
    frames = np.flatnonzero(shown)
    if len(frames) < 2 * NEIGHBOURS:
        return []
    lasted = np.diff(time_s[frames])
    period = float(np.median(np.diff(time_s)))
    if period <= 0 or lasted.min() <= 0:
        return []
    pace = np.diff(travel[frames]) * period / lasted
    found = []
    for place in range(2, len(pace) - 2):
        near = np.concatenate([pace[max(0, place - NEIGHBOURS) : place], pace[place + 1 : place + 1 + NEIGHBOURS]])
        usual = float(np.median(near))
        if abs(usual) <= 8 * noise or np.abs(near / usual - 1).max() > 0.35:
            continue
        ratio = float(pace[place] / usual)
        if ratio > 1.65:
            found.append(DroppedFrames(int(frames[place]), round(ratio) - 1))
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
