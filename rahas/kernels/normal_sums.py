"""Three unknowns of a pixel, a + x·f + y·g, from sums over its frames; f and g are cos δ and sin δ, or w and w′."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, FloatArray

SUMS = 10  # Σ of 1, f, g, f², f·g, g², I, I·f, I·g, I²
PART = 1 << 15  # pixels solved at a time: what is kept in between would be many times the field


class PlaneFit(NamedTuple):
    """Each (pixel,)."""

    level: FloatArray  # a, grey levels
    first: FloatArray  # x, grey levels
    second: FloatArray  # y, grey levels
    noise: FloatArray  # grey levels, standard deviation of the residuals
    second_variance: FloatArray  # variance of y for noise of variance 1
    frames: FloatArray  # number of frames


def solve_sums(sums: AnyArray) -> PlaneFit:
    """Solve the normal equations of each pixel; where the frames do not determine it, x = y = 0 and noise is infinite.

    Parameters
    ----------
    sums
        (pixel, SUMS) or wider.
    """
    fit = PlaneFit(*(np.empty(len(sums)) for _ in PlaneFit._fields))
    for first in range(0, len(sums), PART):
        for whole, part in zip(fit, _solve_part(sums[first : first + PART]), strict=True):
            whole[first : first + PART] = part
    return fit


def _solve_part(sums: AnyArray) -> PlaneFit:
    one, f, g, ff, fg, gg, i, fi, gi, ii = (sums[:, k].astype(np.float64) for k in range(SUMS))
    count, one = one, np.maximum(one, 1.0)
    # means removed: two unknowns are left
    ff, fg, gg = ff - f * f / one, fg - f * g / one, gg - g * g / one
    fi, gi = fi - f * i / one, gi - g * i / one
    determinant = ff * gg - fg * fg
    good = determinant > 1e-3 * one * one
    safe = np.where(good, determinant, 1.0)
    first = np.where(good, (gg * fi - fg * gi) / safe, 0.0)
    second = np.where(good, (ff * gi - fg * fi) / safe, 0.0)
    left = ii - i * i / one - first * fi - second * gi
    noise = np.sqrt(np.maximum(left, 0.0) / np.maximum(one - 3.0, 1.0))
    return PlaneFit(
        (i - first * f - second * g) / one,
        first,
        second,
        np.where(good, noise, np.inf),
        np.where(good, ff / safe, np.inf),
        count,
    )
