"""Derivatives by differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rahas.typing import AnyArray, FloatArray


def forward_differences(
    function: Callable[[FloatArray], FloatArray], at: FloatArray, scale: FloatArray, *, only: AnyArray | None = None
) -> FloatArray:
    """∂function/∂parameter (n, p), a column a parameter (those numbered in ``only``), steps of 1e-6 of ``scale``."""
    here = function(at)
    columns = []
    for index in range(at.size) if only is None else only:
        moved = at.copy()
        moved[index] += 1e-6 * scale[index]
        columns.append((function(moved) - here) / (1e-6 * scale[index]))
    return np.column_stack(columns)
