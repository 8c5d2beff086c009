"""Ingest: what each frame shows in figures and in small, block by block while the capture is decoded."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.interlacing import (
    BOTTOM_FIRST,
    FieldDistances,
    Interlacing,
    field_distances,
    recognise_interlacing,
)
from rahas.typing import AnyArray, BoolArray, FloatArray

THUMBNAIL_BLOCK = 4
_SUPERWHITE = 240  # of 255: a limited-range camera that stops at 235 never gets here
_SUPERWHITE_SHARE = 1e-4


class BlockMeasures(NamedTuple):
    """Measures of some frames that follow each other; shares are of the frame's pixels."""

    mean_level: FloatArray
    """(frame), grey levels"""
    change: FloatArray
    """(frame), mean absolute difference from the frame before, grey levels; 0 for the first frame of all"""
    low_shares: FloatArray
    """(frame, candidate): pixels at or below 0 and at or below 16 of 255"""
    high_shares: FloatArray
    """(frame, candidate): pixels at or above 255, 235 and 240 of 255 (less one level)"""
    distances: FloatArray
    """(frame, 3): within, top step, bottom step from the frame before; NaN for the first frame of all"""
    thumbnails: AnyArray
    """(field, frame, y_thumb, x_thumb) uint16: means over 2 rows of the top and of the bottom field x 4 columns"""


class CaptureMeasures(NamedTuple):
    """Per-frame statistics of a whole capture."""

    mean_level: FloatArray
    clipped_low_share: FloatArray
    clipped_high_share: FloatArray
    change: FloatArray
    interlacing: Interlacing
    clip_levels: tuple[int, int]
    """the grey levels at and beyond which a pixel counts as clipped"""


def thumbnail_scale(bit_depth: int) -> float:
    """What a grey level is worth in a thumbnail: 64, or less where more than 10 bits would not fit 16."""
    return float(2 ** (16 - max(bit_depth, 10)))


def thumbnail_shape(height: int, width: int) -> tuple[int, int]:
    """(y_thumb, x_thumb); rows and columns that fill no block are left out."""
    return height // THUMBNAIL_BLOCK, width // THUMBNAIL_BLOCK


def measure_block(frames: AnyArray, before: AnyArray | None, *, bit_depth: int) -> BlockMeasures:
    """Measure ``frames`` (frame, y, x), ``before`` (y, x) being the frame that comes before them."""
    count, height, width = frames.shape
    small = thumbnail_shape(height, width)
    thumbnails = np.zeros((2, count, *small), np.uint16)
    rows: list[list[float]] = []
    for n, frame in enumerate(frames):
        last = frames[n - 1] if n else before
        low, high = _end_shares(frame, bit_depth)
        if last is None:
            change, distances = 0.0, (np.nan, np.nan, np.nan)
        else:
            change = float(cv2.norm(frame, last, cv2.NORM_L1)) / frame.size
            distances = field_distances(last, frame) if height >= 4 else (0.0, 0.0, 0.0)
        rows.append([cv2.mean(frame)[0], change, *low, *high, *distances])
        thumbnails[:, n] = _half_thumbnails(frame, small, bit_depth)
    table = np.array(rows, np.float64).reshape(count, 10)
    return BlockMeasures(table[:, 0], table[:, 1], table[:, 2:4], table[:, 4:7], table[:, 7:10], thumbnails)


def join_measures(
    blocks: list[BlockMeasures], *, bit_depth: int, luma_range: str, flagged_order: str
) -> CaptureMeasures:
    """Put the blocks' figures together and decide what only the whole capture tells: interlacing and clip levels."""
    mean_level, change, low, high, distances = (
        np.concatenate([block[k] for block in blocks]) if blocks else np.zeros((0, 3)) for k in range(5)
    )
    known = distances[np.isfinite(distances).all(axis=1)] / 4.0 ** (bit_depth - 8)
    interlacing = recognise_interlacing(FieldDistances(*known.T), flagged_order)
    superwhite = _has_superwhite(high[:, 2])
    limited = luma_range != "full" and not superwhite
    low_candidate = 0 if luma_range == "full" or (luma_range == "unknown" and superwhite) else 1
    high_candidate = 1 if limited else 0
    levels = (_level(16, bit_depth) if low_candidate else 0, _level(234 if limited else 254, bit_depth))
    return CaptureMeasures(mean_level, low[:, low_candidate], high[:, high_candidate], change, interlacing, levels)


def finish_thumbnails(halves: AnyArray, field_order: str) -> AnyArray:
    """(field, frame, y, x) halves → (frame, y, x): the first field alone if interlaced, else the mean of both."""
    if field_order == "progressive":
        total = halves[0].astype(np.uint32)
        total += halves[1]
        total += 1
        total >>= 1
        return total.astype(np.uint16)
    return halves[1 if field_order == BOTTOM_FIRST else 0]


def _end_shares(frame: AnyArray, bit_depth: int) -> tuple[tuple[float, float], tuple[float, float, float]]:
    lows = 0, _level(16, bit_depth)
    highs = _level(254, bit_depth), _level(234, bit_depth), _level(_SUPERWHITE, bit_depth)
    if frame.dtype == np.uint8:
        counts = cv2.calcHist([frame], [0], None, [256], [0, 256]).ravel()
        low, high = [float(counts[: k + 1].sum()) for k in lows], [float(counts[k:].sum()) for k in highs]
    else:
        low, high = (
            [float(np.count_nonzero(frame <= k)) for k in lows],
            [float(np.count_nonzero(frame >= k)) for k in highs],
        )
    return (low[0] / frame.size, low[1] / frame.size), (
        high[0] / frame.size,
        high[1] / frame.size,
        high[2] / frame.size,
    )


def _level(of_255: int, bit_depth: int) -> int:
    return of_255 << (bit_depth - 8) if bit_depth >= 8 else of_255 >> (8 - bit_depth)


def _has_superwhite(shares: FloatArray) -> bool:
    reached: BoolArray = shares > _SUPERWHITE_SHARE
    return bool(reached.any())


def _half_thumbnails(frame: AnyArray, small: tuple[int, int], bit_depth: int) -> AnyArray:
    if 0 in small:
        return np.zeros((2, *small), np.uint16)
    whole = frame[: small[0] * THUMBNAIL_BLOCK, : small[1] * THUMBNAIL_BLOCK]
    if bit_depth <= 10:
        whole = np.left_shift(whole, 6, dtype=np.uint16)
    elif bit_depth < 16:
        whole = np.left_shift(whole, 16 - bit_depth, dtype=np.uint16)
    return np.stack([cv2.resize(whole[k::2], small[::-1], interpolation=cv2.INTER_AREA) for k in (0, 1)])
