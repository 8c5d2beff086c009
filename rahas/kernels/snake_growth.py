"""Growing snakes over what tracking left unnamed (thesis 3.4.3): ``SnakeFind_growLeft``, ``SnakeFind_growRight``.

The thesis goes on from the end of a snake to the nearest valid pixel of the next columns. Here a whole chain is taken
on, and only where every neighbour agrees: names must rise down each column, and the distance to the next named stripe
must be a likely multiple of the pitch. Across a depth step the next stripe's end may lie just where this one should
go on; wrong growth is worse than a gap.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.kernels.peaks import Peaks
from rahas.kernels.snake_chains import Chains
from rahas.typing import AnyArray, Float32Array


class GrowthRule(NamedTuple):
    """How far and how freely snakes grow; distances in pixels."""

    pitch_px: float
    """Distance of stripes in the first frame."""
    gap_px: int
    """x_mgrow: columns that a snake may jump."""
    reach_px: float
    """y_mgrow: rows that a snake's straight continuation may be off."""
    min_spacing: float
    """Smallest distance of neighbouring stripes, in pitches, for names to stay."""
    max_spacing: float
    """Largest one."""
    grow_min_spacing: float
    """Smallest distance of neighbouring stripes, in pitches, for names to be added."""
    grow_max_spacing: float
    """Largest one."""
    min_length_px: int
    """Shortest chain that a neighbour above or below may name."""


def drop_contradictions(peaks: Peaks, chains: Chains, names: AnyArray, rule: GrowthRule) -> AnyArray:
    """Names with those taken away that break the order of a column or lie at an unlikely distance.

    Of two peaks that contradict each other the one of the chain with fewer named pixels loses its name; a chain that
    loses a third of its names loses them all.
    """
    kept = names.copy()
    if chains.first.size == 0:
        return kept
    before = _named_pixels(chains, names)
    _drop(peaks.y, peaks.counts, chains.number, before, rule.pitch_px, rule.min_spacing, rule.max_spacing, kept)
    lost = _named_pixels(chains, kept) < 0.67 * before
    kept[np.append(lost, False)[chains.number]] = 0
    return kept


def multi_pass_grow(peaks: Peaks, chains: Chains, names: AnyArray, rule: GrowthRule, *, snakes: int) -> AnyArray:
    """``SnakeFind_multiPassGrow``: grow left and right, then up and down, until nothing is added (at most 4 times).

    Names run from 1 to ``snakes``: a chain whose neighbours would give it a name beyond stays without.
    """
    grown = names.copy()
    for _ in range(4):
        added = _grow_sideways(
            peaks.y, peaks.counts, chains.number, chains.first, chains.last, chains.start, chains.y, chains.slot,
            rule.pitch_px, rule.gap_px, rule.reach_px, rule.grow_min_spacing, rule.grow_max_spacing, grown,
        )  # fmt: skip
        added += _grow_by_neighbours(
            peaks.y, peaks.counts, chains.number, chains.first, chains.last, chains.start, chains.y, chains.slot,
            rule.pitch_px, rule.grow_min_spacing, rule.grow_max_spacing, rule.min_length_px, snakes, grown,
        )  # fmt: skip
        if added == 0:
            break
    return grown


def _named_pixels(chains: Chains, names: AnyArray) -> AnyArray:
    counted: AnyArray = np.bincount(chains.number[names > 0], minlength=chains.first.size).astype(np.int32)
    return counted


@numba.njit(cache=True, nogil=True)
def _drop(
    y: Float32Array,
    count: AnyArray,
    chain: AnyArray,
    support: AnyArray,
    pitch: float,
    low: float,
    high: float,
    names: AnyArray,
) -> None:
    for x in range(count.size):
        for _ in range(count[x]):
            previous = -1
            dropped = False
            for i in range(count[x]):
                if names[x, i] == 0:
                    continue
                if previous >= 0:
                    steps = names[x, i] - names[x, previous]
                    gap = (y[x, i] - y[x, previous]) / pitch
                    if steps < 1 or gap < low * steps or gap > high * steps:
                        weaker = i if support[chain[x, i]] <= support[chain[x, previous]] else previous
                        names[x, weaker] = 0
                        dropped = True
                        break
                previous = i
            if not dropped:
                break


@numba.njit(cache=True, nogil=True)
def _fits(
    c: int, name: int, y: Float32Array, count: AnyArray, first: AnyArray, last: AnyArray, start: AnyArray,
    slot: AnyArray, pitch: float, low: float, high: float, names: AnyArray,
) -> bool:  # fmt: skip
    good = 0
    bad = 0
    for x in range(first[c], last[c] + 1):
        i = slot[start[c] + x - first[c]]
        for side in (-1, 1):
            j = i + side
            while 0 <= j < count[x] and names[x, j] == 0:
                j += side
            if j < 0 or j >= count[x]:
                continue
            steps = side * (names[x, j] - name)
            gap = abs(y[x, j] - y[x, i]) / pitch
            if steps >= 1 and low * steps <= gap <= high * steps:
                good += 1
            else:
                bad += 1
    return bad <= 0.05 * (good + bad)


@numba.njit(cache=True, nogil=True)
def _set(c: int, name: int, first: AnyArray, last: AnyArray, start: AnyArray, slot: AnyArray, names: AnyArray) -> None:
    for x in range(first[c], last[c] + 1):
        names[x, slot[start[c] + x - first[c]]] = name


@numba.njit(cache=True, nogil=True)
def _grow_sideways(
    y: Float32Array, count: AnyArray, chain: AnyArray, first: AnyArray, last: AnyArray, start: AnyArray,
    chain_y: Float32Array, slot: AnyArray, pitch: float, gap: int, reach: float, low: float, high: float,
    names: AnyArray,
) -> int:  # fmt: skip
    added = 0
    nx = count.size
    for right in (True, False):
        for n in range(first.size):
            c = n if right else first.size - 1 - n
            length = last[c] - first[c] + 1
            end = last[c] if right else first[c]
            at = start[c] + end - first[c]
            name = names[end, slot[at]]
            if name == 0 or length < 4:
                continue
            step = 1 if right else -1
            run = min(length - 1, 12)
            slope = (chain_y[at] - chain_y[at - step * run]) / run
            taken = False
            for d in range(1, gap + 1):
                x = end + step * d
                if x < 0 or x >= nx or taken:
                    break
                expected = chain_y[at] + slope * d
                best = -1
                nearest = reach
                for i in range(count[x]):
                    if abs(y[x, i] - expected) <= nearest:
                        nearest = abs(y[x, i] - expected)
                        best = i
                if best < 0:
                    continue
                taken = True
                other = chain[x, best]
                if names[x, best] == 0 and _fits(
                    other, name, y, count, first, last, start, slot, pitch, low, high, names
                ):
                    _set(other, name, first, last, start, slot, names)
                    added += 1
    return added


@numba.njit(cache=True, nogil=True)
def _grow_by_neighbours(
    y: Float32Array, count: AnyArray, chain: AnyArray, first: AnyArray, last: AnyArray, start: AnyArray,
    chain_y: Float32Array, slot: AnyArray, pitch: float, low: float, high: float, min_length: int, snakes: int,
    names: AnyArray,
) -> int:  # fmt: skip
    added = 0
    for c in range(first.size):
        length = last[c] - first[c] + 1
        if length < min_length or names[first[c], slot[start[c]]] != 0:
            continue
        votes = 0
        against = 0
        name = 0
        for x in range(first[c], last[c] + 1):
            i = slot[start[c] + x - first[c]]
            if names[x, i] != 0:
                against += length
                break
            for side in (-1, 1):
                j = i + side
                if j < 0 or j >= count[x] or names[x, j] == 0:
                    continue
                local = pitch
                if 0 <= j + side < count[x] and names[x, j + side] == names[x, j] + side:
                    local = abs(y[x, j + side] - y[x, j])
                gap = abs(y[x, j] - y[x, i]) / local
                said = names[x, j] - side
                if gap < 0.7 or gap > 1.4:
                    continue
                if name == 0:
                    name = said
                if said == name:
                    votes += 1
                else:
                    against += 1
        if name < 1 or name > snakes or votes < 0.5 * length or against > 0.05 * votes:
            continue
        if _fits(c, name, y, count, first, last, start, slot, pitch, low, high, names):
            _set(c, name, first, last, start, slot, names)
            added += 1
    return added
