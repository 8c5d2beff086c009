"""The three unknowns of a pixel, a + c·cos δ + s·sin δ, from sums over its frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, FloatArray

SUMS = 10  # columns: Σ of 1, cos, sin, cos², cos·sin, sin², I, I·cos, I·sin, I²


class Solution(NamedTuple):
    """Each (pixel,)."""

    background: FloatArray  # a, grey levels
    cosine: FloatArray  # c = b cos φ, grey levels
    sine: FloatArray  # s = −b sin φ, grey levels
    noise: FloatArray  # grey levels, standard deviation of the residuals
    spread: FloatArray  # std of φ times b over noise, from the steps alone


def solve_sums(sums: AnyArray) -> Solution:
    """Solve the normal equations of each pixel; where the steps do not determine it, c = s = 0 and noise is infinite.

    Parameters
    ----------
    sums
        (pixel, SUMS).
    """
    one, c, s, cc, cs, ss, i, ic, is_, ii = (sums[:, k].astype(np.float64) for k in range(SUMS))
    one = np.maximum(one, 1.0)
    # means removed: two unknowns are left
    cc, cs, ss = cc - c * c / one, cs - c * s / one, ss - s * s / one
    ic, is_ = ic - c * i / one, is_ - s * i / one
    determinant = cc * ss - cs * cs
    good = determinant > 1e-3 * one * one
    safe = np.where(good, determinant, 1.0)
    cosine = np.where(good, (ss * ic - cs * is_) / safe, 0.0)
    sine = np.where(good, (cc * is_ - cs * ic) / safe, 0.0)
    level = (i - cosine * c - sine * s) / one
    left = ii - i * i / one - cosine * ic - sine * is_
    noise = np.sqrt(np.maximum(left, 0.0) / np.maximum(one - 3.0, 1.0))
    square = np.maximum(cosine**2 + sine**2, 1e-9)
    # the inverse normal matrix across the phasor (c, s)
    factor = (sine**2 * ss + cosine**2 * cc + 2.0 * sine * cosine * cs) / (safe * square)
    return Solution(
        level, cosine, sine, np.where(good, noise, np.inf), np.where(good, np.sqrt(np.maximum(factor, 0.0)), np.inf)
    )
