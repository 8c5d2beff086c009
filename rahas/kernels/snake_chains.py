"""Chains: peaks of neighbouring columns that belong to one stripe on one unbroken piece of surface.

A snake of the thesis grows pixel by pixel; here the pixels are first joined to chains, each of which gets its identity
whole, by the vote of its tracked pixels. A chain that one stray pixel mislabelled is thus put right, and one whose
pixels disagree is left as they were tracked.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from rahas.kernels.peaks import Peaks
from rahas.typing import AnyArray, BoolArray, Float32Array


class Chains(NamedTuple):
    """Chains of a frame's peaks, numbered from 0; a chain has one peak in every column from its first to its last."""

    number: AnyArray
    """(x, slot) int32 chain of each peak, −1 where there is no peak."""
    first: AnyArray
    """(chain) int32 first column."""
    last: AnyArray
    """(chain) int32 last column."""
    y: Float32Array
    """Rows of all chains, one after the other; chain c's begin at ``start[c]``."""
    slot: AnyArray
    """int32 slot of each of these rows."""
    start: AnyArray
    """(chain) int32 where each chain begins in ``y`` and ``slot``."""


def chains_of_peaks(peaks: Peaks, *, reach_px: float) -> Chains:
    """Join peaks of neighbouring columns that are each other's nearest and no more than ``reach_px`` apart."""
    number = np.full(peaks.y.shape, -1, np.int32)
    first = np.zeros(peaks.y.size, np.int32)
    last = np.zeros(peaks.y.size, np.int32)
    n = _link(peaks.y, peaks.counts, reach_px, number, first, last)
    first, last = first[:n], last[:n]
    start = np.zeros(n, np.int32)
    start[1:] = np.cumsum(last - first + 1)[:-1]
    x, slot = np.nonzero(number >= 0)
    place = start[number[x, slot]] + x - first[number[x, slot]]
    y = np.empty(x.size, np.float32)
    slots = np.empty(x.size, np.int32)
    y[place] = peaks.y[x, slot]
    slots[place] = slot
    return Chains(number, first, last, y, slots, start)


def names_by_vote(chains: Chains, votes: AnyArray, *, min_agreement: float) -> AnyArray:
    """Names of all peaks from those of the tracked ones: a chain takes the name that its pixels agree on.

    Parameters
    ----------
    votes
        (x, slot) int16 names of tracked peaks, 0 for none.
    min_agreement
        Share of a chain's votes that its commonest name must have for the whole chain to get it; else only the voters
        keep their names.
    """
    if chains.first.size == 0:
        return votes.copy()
    winner, support, total = _tally(chains, votes)
    agreed = (total > 0) & (support >= min_agreement * total)
    whole: BoolArray = np.append(agreed, False)[chains.number]
    names: AnyArray = np.where(whole, np.append(winner, 0)[chains.number], votes).astype(np.int16)
    return names


def names_added(chains: Chains, names: AnyArray, votes: AnyArray, *, min_share: float, min_length_px: int) -> AnyArray:
    """Names with those of chains that had none, where ``min_share`` of all pixels of a chain vote for one name."""
    if chains.first.size == 0:
        return names.copy()
    winner, support, _ = _tally(chains, votes)
    length = chains.last - chains.first + 1
    unnamed = np.bincount(chains.number[names > 0], minlength=length.size) == 0
    agreed = unnamed & (length >= min_length_px) & (support >= min_share * length)
    added: BoolArray = np.append(agreed, False)[chains.number]
    out: AnyArray = np.where(added, np.append(winner, 0)[chains.number], names).astype(np.int16)
    return out


def _tally(chains: Chains, votes: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Of each chain: the commonest name, the votes for it, all votes."""
    n = chains.first.size
    top = int(votes.max(initial=0)) + 1
    x, slot = np.nonzero(votes > 0)
    tally = np.bincount(chains.number[x, slot] * top + votes[x, slot], minlength=n * top).reshape(n, top)
    return tally.argmax(axis=1), tally.max(axis=1), tally.sum(axis=1)


@numba.njit(cache=True, nogil=True)
def _link(y: Float32Array, count: AnyArray, reach: float, number: AnyArray, first: AnyArray, last: AnyArray) -> int:
    n = 0
    for x in range(count.size):
        j = 0
        for i in range(count[x]):
            here = y[x, i]
            linked = False
            if x > 0 and count[x - 1] > 0:
                while j + 1 < count[x - 1] and abs(y[x - 1, j + 1] - here) <= abs(y[x - 1, j] - here):
                    j += 1
                gap = abs(y[x - 1, j] - here)
                linked = gap <= reach
                if i > 0 and abs(y[x - 1, j] - y[x, i - 1]) < gap:
                    linked = False
                if i + 1 < count[x] and abs(y[x - 1, j] - y[x, i + 1]) < gap:
                    linked = False
            if linked:
                number[x, i] = number[x - 1, j]
            else:
                number[x, i] = n
                first[n] = x
                n += 1
            last[number[x, i]] = x
    return n
