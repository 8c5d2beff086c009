"""Snakes and rotation code vote on the fringe order of each pixel; where they differ is a measure of quality.

| name | definition |
|---|---|
| certainty | chance that an order is right, as its own method sees it, 0 … 1 |
| offset | integer that brings the code's labels to the snakes' |
| disagreement | share of differing orders among pixels where both are known and the code is confident |
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.rotation_code import CONFIDENT
from rahas.kernels.unwrapping import UNKNOWN_ORDER
from rahas.typing import AnyArray, BoolArray, Float32Array

MIN_COMMON = 200
"""Pixels named by both, below which nothing is said of offset and disagreement."""
_ROWS = 128  # voted on at a time
_DOUBT = 0.08  # confidence of the code that leaves a chance of 1/e to be wrong


class Votes(NamedTuple):
    """What was agreed on."""

    order: AnyArray
    """(y, x) int16, −32768 where neither is sure enough."""
    confidence: Float32Array
    """(y, x) 0 … 1."""
    disagreement: float | None
    """None: too few pixels are known to both."""
    offset: int
    """Added to the code's orders."""


def code_certainty(confidence: AnyArray) -> Float32Array:
    """Certainty of an order with this confidence of the search."""
    return np.asarray(1.0 - np.exp(-np.asarray(confidence, np.float32) / np.float32(_DOUBT)), np.float32)


def label_offset(snake_order: AnyArray, code_order: AnyArray, sure: BoolArray) -> int | None:
    """The commonest difference snakes − code over ``sure`` pixels known to both; None: fewer than ``MIN_COMMON``."""
    both = sure & (snake_order != UNKNOWN_ORDER) & (code_order != UNKNOWN_ORDER)
    if np.count_nonzero(both) < MIN_COMMON:
        return None
    difference = snake_order[both].astype(np.int32) - code_order[both]
    values, counts = np.unique(difference, return_counts=True)
    return int(values[counts.argmax()])


def voted_orders(
    snake_order: AnyArray,
    snake_confidence: AnyArray,
    code_order: AnyArray,
    code_confidence: AnyArray,
    *,
    offset: int,
) -> Votes:
    """One order a pixel, (y, x) arrays; ``UNKNOWN_ORDER`` where nothing is known.

    A confident code decides, whatever the snakes say: it needs no neighbour and crosses depth steps. An unsure one
    counts where it agrees with the snakes, or where there are none and it is not merely guessing.
    """
    order, confidence = np.empty(snake_order.shape, np.int16), np.empty(snake_order.shape, np.float32)
    asked = differing = 0
    for first in range(0, len(snake_order), _ROWS):
        rows = slice(first, first + _ROWS)
        voted = _voted(snake_order[rows], snake_confidence[rows], code_order[rows], code_confidence[rows], offset)
        order[rows], confidence[rows] = voted.order, voted.confidence
        asked, differing = asked + voted.asked, differing + voted.differing
    disagreement = differing / asked if asked >= MIN_COMMON else None
    return Votes(order, confidence, disagreement, offset)


class _Voted(NamedTuple):
    """Some rows' votes."""

    order: AnyArray
    confidence: AnyArray
    asked: int
    """Pixels known to both, the code confident …"""
    differing: int
    """… and the snakes of another mind."""


def _voted(
    snake_order: AnyArray, snake_confidence: AnyArray, code_order: AnyArray, code_confidence: AnyArray, offset: int
) -> _Voted:
    in_code, in_snakes = code_order != UNKNOWN_ORDER, snake_order != UNKNOWN_ORDER
    code = np.where(in_code, code_order.astype(np.int32) + offset, 0)
    ours = np.where(in_code, code_certainty(code_confidence), 0.0)
    theirs = np.where(in_snakes, np.clip(snake_confidence, 0.0, 1.0), 0.0)
    both = in_code & in_snakes
    same = both & (code == snake_order)
    confident = in_code & (code_confidence >= CONFIDENT)
    differ = both & ~same
    by_code = same | confident | (in_code & ~in_snakes & (code_confidence >= 0.5 * CONFIDENT))
    by_snakes = in_snakes & ~by_code & ~(differ & (ours >= theirs))
    agreed = 1.0 - (1.0 - ours) * (1.0 - theirs)
    alone = np.where(by_code, ours, theirs)
    contested = alone * alone / np.maximum(ours + theirs, 1e-6)
    confidence = np.where(same, agreed, np.where(differ, contested, alone))
    known = by_code | by_snakes
    order = np.where(by_code, code, np.where(by_snakes, snake_order, UNKNOWN_ORDER)).astype(np.int16)
    asked = both & confident
    return _Voted(
        order, np.where(known, confidence, 0.0), int(np.count_nonzero(asked)), int(np.count_nonzero(asked & ~same))
    )
