"""Phase steps from the displacement of snakes (thesis 3.12–3.14).

A snake lies where Φ + step = 2π·(identity − 1). At the reference slide position (step 0) the snakes of a column
therefore map row to phase; where a snake lies in another frame, that map gives Φ there, and the step is what is
missing.
"""

from __future__ import annotations

import numpy as np

from rahas.typing import AnyArray, FloatArray


def steps_from_snakes(
    *,
    reference_identity: AnyArray,
    reference_y: AnyArray,
    identity: AnyArray,
    y: AnyArray,
    columns: AnyArray | None = None,
    rows: tuple[float, float] | None = None,
) -> FloatArray:
    """Phase step of each frame, from its snakes and those of the reference frame.

    Parameters
    ----------
    reference_identity, reference_y
        (snake, x): snake matrices Si and Sy at the reference slide position; identity 0 is blank.
    identity, y
        (frame, snake, x): the same for each frame.
    columns
        Columns to use (all by default).
    rows
        Only snakes between these rows of a frame count: the step varies over the field, and this is where it is wanted.

    Returns
    -------
    steps
        (frame,), radians, NaN where no snake could be compared: frame n shows cos(Φ + step).
    """
    use = np.arange(reference_y.shape[1]) if columns is None else np.asarray(columns)
    found = np.full((*y.shape[:2], len(use)), np.nan, np.float32)
    for number, x in enumerate(use):
        known = reference_identity[:, x] > 0
        if known.sum() < 2:
            continue
        order = np.argsort(reference_y[known, x])
        rows_of_reference = reference_y[known, x][order]
        turns_of_reference = reference_identity[known, x][order] - 1.0
        rows_now = y[:, :, x]
        here = np.interp(rows_now, rows_of_reference, turns_of_reference, left=np.nan, right=np.nan)
        counts = identity[:, :, x] > 0
        if rows is not None:
            counts &= (rows_now >= rows[0]) & (rows_now <= rows[1])
        found[:, :, number] = np.where(counts, identity[:, :, x] - 1.0 - here, np.nan)
    return np.array([2.0 * np.pi * np.median(f[np.isfinite(f)]) if np.isfinite(f).any() else np.nan for f in found])


def fill_missing_steps(steps: FloatArray) -> FloatArray:
    """Steps of frames without snakes, linearly between their neighbours. (frame,) → (frame,), radians."""
    good = np.isfinite(steps)
    if not good.any():
        raise ValueError(f"no frame has a phase step: {steps.shape = }")
    n = np.arange(len(steps))
    return np.interp(n, n[good], steps[good])
