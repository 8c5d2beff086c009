"""First labels: the stripes of the first frame numbered from the top (thesis 3.4.2): ``SnakeFind_init2Snake``.

In epipolar alignment stripes run straight whatever the surface, so the number of a stripe is a smooth function of the
place on the canvas. A few stripes numbered at the middle of the canvas fix that function; it then numbers every
other piece of stripe, across shadows and depth steps, that no growing pixel by pixel would reach.
"""

from __future__ import annotations

import numpy as np

from rahas.kernels.peaks import Peaks, collapse_slice, find_collapse_peaks
from rahas.kernels.snake_chains import Chains, names_by_vote
from rahas.typing import AnyArray, FloatArray, IntArray

DELTA_Y_PX = 10
DELTA_X_PX = 5
_BANDS = (0.0, 0.06, -0.06, 0.12, -0.12, 0.2, -0.2, 0.3, -0.3)
_MIN_STRIPES = 3
_MAX_RESIDUAL = 0.25
_FIT_POINTS = 1500


def first_names(peaks: Peaks, chains: Chains, *, pitch_px: float) -> AnyArray:
    """Names (x, slot) int16 of the first frame's peaks; 1 is the topmost stripe, 0 stays where none is certain."""
    seeds = init_to_snake(peaks, pitch_px=pitch_px)
    names = names_by_vote(chains, seeds, min_agreement=0.6)
    names = _named_by_straightness(peaks, chains, names)
    seen = np.unique(names[names > 0])
    if seen.size:
        names[names > 0] -= seen[0] - 1
    return names


def init_to_snake(peaks: Peaks, *, pitch_px: float) -> AnyArray:
    """``SnakeFind_init2Snake``: one named peak a stripe in a narrow band, equation 3.8; names are 1001, 1002, ….

    The band is the middle of the canvas or, where a shadow hides stripes there, the nearest one of a few others that
    shows clearly more of them. Two maxima further apart than a pitch leave numbers for the stripes hidden between them.
    """
    nx = peaks.counts.size
    dm = max(2, int(pitch_px / 4))
    best: tuple[int, IntArray] = (nx // 2, np.zeros(0, np.int64))
    for share in _BANDS:
        x_mid = int(nx // 2 + share * nx)
        collapsed = collapse_slice(peaks.mask, x_mid, dm)
        rows = np.flatnonzero(find_collapse_peaks(collapsed) & (collapsed >= dm))
        rows = _apart(rows, collapsed, 0.5 * pitch_px)
        if rows.size > best[1].size + (1 if best[1].size else 0):
            best = (x_mid, rows)
    x_mid, rows = best
    seeds = np.zeros(peaks.y.shape, np.int16)
    if rows.size < _MIN_STRIPES:
        return seeds
    gaps = np.diff(rows)
    near = gaps[gaps < 1.5 * pitch_px]
    steps = np.maximum(1, np.rint(gaps / (np.median(near) if near.size else pitch_px)))
    numbers = 1001 + np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)
    reach = min(DELTA_Y_PX, 0.4 * pitch_px)
    for row, number in zip(rows, numbers, strict=True):
        for dx in sorted(range(-DELTA_X_PX, DELTA_X_PX + 1), key=abs):
            x = x_mid + dx
            if not 0 <= x < nx or peaks.counts[x] == 0:
                continue
            away = np.abs(peaks.y[x, : peaks.counts[x]] - row)
            if away.min() < reach:
                seeds[x, int(away.argmin())] = number
                break
    return seeds


def stripe_numbers(names: AnyArray, peaks: Peaks, x: FloatArray, y: FloatArray) -> FloatArray:
    """Number of the stripe, with fraction, at canvas points of the first frame: a cubic through its named peaks."""
    nx, ny = peaks.mask.shape
    at, slot = np.nonzero(names > 0)
    thin = slice(None, None, max(1, at.size // _FIT_POINTS))
    at, slot = at[thin], slot[thin]
    terms = _terms((at - nx / 2) / nx, (peaks.y[at, slot].astype(np.float64) - ny / 2) / nx, 3)
    coefficients = np.linalg.lstsq(terms, names[at, slot].astype(np.float64), rcond=None)[0]
    wanted = _terms(((x - nx / 2) / nx).ravel(), ((y - ny / 2) / nx).ravel(), 3) @ coefficients
    out: FloatArray = wanted.reshape(x.shape)
    return out


def first_positions(names: AnyArray, peaks: Peaks, *, snakes: int) -> FloatArray:
    """Row of each snake at the middle column of the canvas in the first frame, from the numbering's smooth function.

    A snake that a shadow hides there, or that is seen elsewhere only, is placed by its neighbours; NaN for snakes that
    the first frame does not show, and where it shows too few.
    """
    nx = peaks.counts.size
    x, slot = np.nonzero(names > 0)
    out = np.full(snakes, np.nan)
    terms = _terms((x - nx / 2) / nx, names[x, slot] / snakes, 3)
    if x.size < 5 * terms.shape[1]:
        return out
    thin = slice(None, None, max(1, x.size // _FIT_POINTS))
    coefficients = np.linalg.lstsq(terms[thin], peaks.y[x, slot][thin].astype(np.float64), rcond=None)[0]
    seen = np.unique(names[x, slot])
    middle = np.full(seen.size, (nx // 2 - nx / 2) / nx)
    out[seen - 1] = _terms(middle, seen / snakes, 3) @ coefficients
    return out


def _apart(rows: IntArray, weight: IntArray, least: float) -> IntArray:
    """Rows with those left out that lie closer than ``least`` to a weightier one."""
    kept = [r for r in rows if all(abs(r - o) >= least or (weight[o], -o) < (weight[r], -r) or o == r for o in rows)]
    return np.array(kept, dtype=np.int64)


def _terms(a: FloatArray, b: FloatArray, degree: int) -> FloatArray:
    return np.column_stack([a**i * b**j for i in range(degree + 1) for j in range(degree + 1 - i)])


def _named_by_straightness(peaks: Peaks, chains: Chains, names: AnyArray) -> AnyArray:
    """Number all chains by a polynomial of the place, fitted to those already numbered: degree 1, then 2, then 3."""
    x, slot = np.nonzero(chains.number >= 0)
    if not np.any(names > 0):
        return names
    chain = chains.number[x, slot]
    nx, ny = peaks.mask.shape
    px, py = (x - nx / 2) / nx, (peaks.y[x, slot] - ny / 2) / nx
    n = chains.first.size
    length = np.bincount(chain, minlength=n)
    known = names[x, slot].astype(np.float64)
    for degree in (1, 2, 2, 3, 3):
        used = np.flatnonzero(known > 0)
        terms = _terms(px, py, degree)
        if used.size < 20 * terms.shape[1]:
            return names
        used = used[:: max(1, used.size // _FIT_POINTS)]
        coefficients = np.linalg.lstsq(terms[used], known[used], rcond=None)[0]
        predicted = terms @ coefficients
        mean = np.bincount(chain, predicted, minlength=n) / length
        number = np.rint(mean)
        off = np.abs(predicted - number[chain])
        wide = np.bincount(chain, off, minlength=n) / length
        trusted = (np.abs(mean - number) < _MAX_RESIDUAL) & (wide < _MAX_RESIDUAL)
        known = np.where(trusted[chain], number[chain], 0.0)
    out = np.zeros_like(names)
    out[x, slot] = known
    return out
