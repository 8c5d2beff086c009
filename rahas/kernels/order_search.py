"""The fringe order of each pixel by itself: what it saw of the rotation against what every candidate predicts.

With β_pn = p_n + c_n·Φ0 + s_n·φ/2π the candidate m predicts A_n·cos 2π(β_pn + m·s_n), and misses the signal z_pn by

    E_m = Σ z² + ½ΣA² − 2·Σ_n [A·z·cos 2π(β + m·s) − ¼·A²·cos 4π(β + m·s)]    (sums over n).

Sums of angles split the cosines into a part of the pixel and a part of the candidate: one cosine and one sine a sample
whatever the number of candidates, and a matrix product. No neighbour takes part.

Two orders look alike where c_n·Φ0 keeps still and Φ1 − ψ0 and its negative are whole turns apart: short dashes on the
line through the slide's axis. The confidence says so.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.kernels.rotation_model import SIGNAL_LIMIT, TURN, Course, RotationPixels
from rahas.typing import AnyArray, Float32Array

_CHUNK = 4096
_FLOOR = 0.02
"""Misfit that the model itself may have, in signal energies."""


class OrderSearch(NamedTuple):
    """Best candidate of each pixel."""

    order: AnyArray
    """(pixel) int32 m."""
    confidence: Float32Array
    """(pixel) (E₂ − E₁)/(E₂ + E₁) of the second best and the best candidate, 0 … 1."""


def search_orders(pixels: RotationPixels, *, first: AnyArray, course: Course, candidates: AnyArray) -> OrderSearch:
    """Best order of each pixel among ``candidates`` (consecutive integers); ``first`` is (pixel) Φ0 in turns."""
    count = pixels.levels.shape[1]
    out = OrderSearch(np.empty(count, np.int32), np.empty(count, np.float32))
    per_frame = np.stack(
        [course.piston, course.aligned, course.across, 1.0 / course.gain, -course.offset / course.gain], axis=1
    ).astype(np.float32)
    table = candidate_table(course, candidates)
    energy = np.float32(0.5 * np.sum(course.swing**2))
    for start in range(0, count, _CHUNK):
        part = slice(start, min(start + _CHUNK, count))
        per_pixel = np.stack(
            [first[part], pixels.wrapped[part], pixels.background[part], 1.0 / pixels.modulation[part]]
        ).astype(np.float32)
        turned, power = _turned(
            np.ascontiguousarray(pixels.levels[:, part]), per_pixel, per_frame, np.float32(SIGNAL_LIMIT)
        )
        _best_two(table @ turned, power, energy, int(candidates[0]), *(a[part] for a in out))
    return out


def candidate_table(course: Course, candidates: AnyArray) -> Float32Array:
    """(candidate, 4·frame) the candidates' factors of z·cos 2πβ, z·sin 2πβ, cos 4πβ and sin 4πβ."""
    turns = np.outer(candidates, course.across) * TURN
    swing, square = course.swing, -0.25 * course.swing**2
    parts = [swing * np.cos(turns), -swing * np.sin(turns), square * np.cos(2 * turns), -square * np.sin(2 * turns)]
    return np.concatenate(parts, axis=1).astype(np.float32)


@numba.njit(cache=True, inline="always", fastmath=True)
def _cosine(turns):  # type: ignore[no-untyped-def]
    """Cos of 2π·turns to about 4e-6, as a polynomial that vectorises."""
    x = turns - np.floor(turns + np.float32(0.5))
    y = np.float32(2 * np.pi) * (np.float32(0.25) - abs(x))
    z = y * y
    odd = np.float32(-1 / 5040) + z * np.float32(1 / 362880)
    return y * (np.float32(1) + z * (np.float32(-1 / 6) + z * (np.float32(1 / 120) + z * odd)))


@numba.njit(cache=True, fastmath=True)
def _turned(levels, per_pixel, per_frame, limit):  # type: ignore[no-untyped-def]
    """z·cos 2πβ, z·sin 2πβ, cos 4πβ, sin 4πβ, one above the other (4·frame, pixel), and Σ z² (pixel)."""
    frames, pixels = levels.shape
    turned = np.empty((4 * frames, pixels), np.float32)
    power = np.zeros(pixels, np.float32)
    one, two = np.float32(1), np.float32(2)
    first, wrapped, background, over = per_pixel[0], per_pixel[1], per_pixel[2], per_pixel[3]
    for n in range(frames):
        piston, aligned, across = per_frame[n, 0], per_frame[n, 1], per_frame[n, 2]
        lift, base = per_frame[n, 3], per_frame[n, 4]
        for p in range(pixels):
            turns = piston + aligned * first[p] + across * wrapped[p]
            value = (np.float32(levels[n, p]) * lift + base - background[p]) * over[p]
            value = min(max(value, -limit), limit)
            cosine, sine = _cosine(turns), _cosine(turns - np.float32(0.25))
            turned[n, p] = value * cosine
            turned[frames + n, p] = value * sine
            turned[2 * frames + n, p] = two * cosine * cosine - one
            turned[3 * frames + n, p] = two * cosine * sine
            power[p] += value * value
    return turned, power


@numba.njit(cache=True)
def _best_two(score, power, energy, lowest, order, confidence):  # type: ignore[no-untyped-def]
    count, pixels = score.shape
    floor = np.float32(_FLOOR) * energy
    for p in range(pixels):
        best, second, at = np.float32(-1e30), np.float32(-1e30), 0
        for m in range(count):
            value = score[m, p]
            if value > best:
                second, best, at = best, value, m
            elif value > second:
                second = value
        whole = power[p] + energy
        misfit = whole - best - best + floor
        other = whole - second - second + floor
        order[p] = lowest + at
        confidence[p] = max(np.float32(0.0), (other - misfit) / (other + misfit))
