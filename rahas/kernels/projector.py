"""The projector: world mm → Φ/2π by a 2 × 4 matrix (the y row and the common row of thesis equations 2.10–2.12).

With m12 = 1: Φ/2π = (m5·X + m6·Y + m7·Z + m8) / (m9·X + m10·Y + m11·Z + 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.levenberg_marquardt import inverse_of_normal, minimise_squares
from rahas.kernels.projector_lens import NO_LENS, Lens, phase_through_lens
from rahas.typing import AnyArray, BoolArray, FloatArray

MIN_POINTS = 7


class ProjectorFit(NamedTuple):
    """A projector fitted to points of known phase."""

    matrix: FloatArray
    """(2, 4), m12 = 1."""
    residual: FloatArray
    """(n,) rad, measured minus predicted, of all points."""
    used: BoolArray
    """(n,) points that were not rejected."""
    covariance: FloatArray
    """(7, 7) of m5…m11."""
    sigma_rad: float
    """Robust standard deviation of the used residuals."""


def phase_of_projector(matrix: FloatArray, world: FloatArray) -> FloatArray:
    """Unwrapped phase (…) in radians at world points (…, 3)."""
    top, bottom = np.moveaxis(world @ matrix[:, :3].T + matrix[:, 3], -1, 0)
    phase: FloatArray = 2.0 * np.pi * top / bottom
    return phase


def fit_projector(
    world: FloatArray,
    unwrapped_phase: FloatArray,
    *,
    start: FloatArray | None = None,
    gate: float = 4.0,
    lens: Lens = NO_LENS,
) -> ProjectorFit:
    """Projector matrix by least squares of phase over the points that fit within ``gate`` robust standard deviations.

    ``world`` (n, 3) mm on both slopes, ``unwrapped_phase`` (n,) rad. Without ``start`` the linear solution of all
    points, weighted towards those that agree, begins. The ``lens`` is taken as known.

    Raises
    ------
    ValueError
        Fewer than seven points.
    """
    if len(world) < MIN_POINTS:
        raise ValueError(f"{len(world)} points, a projector needs {MIN_POINTS}")
    matrix = _linear_start(world, unwrapped_phase) if start is None else start
    reach = float(np.abs(world).max()) + 1.0
    turns = float(np.abs(unwrapped_phase).max()) / (2.0 * np.pi) + 1.0
    scale = np.array([turns / reach] * 3 + [turns] + [1.0 / reach] * 3)
    residual = unwrapped_phase - phase_through_lens(matrix, lens, world)
    used = _agreeing(residual, gate)
    for _ in range(4):
        selected, measured = world[used], unwrapped_phase[used]

        def residual_of(
            parameters: FloatArray, points: FloatArray = selected, phases: FloatArray = measured
        ) -> FloatArray:
            return phases - phase_through_lens(projector_from_parameters(parameters), lens, points)

        fit = minimise_squares(residual_of, matrix.ravel()[:7], scale=scale, max_iterations=15)
        matrix = projector_from_parameters(fit.parameters)
        residual = unwrapped_phase - phase_through_lens(matrix, lens, world)
        former, used = used, _agreeing(residual, gate)
        if np.array_equal(former, used):
            break
    freedom = max(fit.residual.size - 7, 1)
    variance = float(fit.residual @ fit.residual) / freedom
    return ProjectorFit(
        matrix, residual, used, variance * inverse_of_normal(fit.normal_matrix), float(np.sqrt(variance))
    )


def projector_from_parameters(parameters: FloatArray) -> FloatArray:
    """Matrix (2, 4) of m5…m11, m12 = 1."""
    return np.append(parameters[:7], 1.0).reshape(2, 4)


def projector_scale(matrix: FloatArray, world: FloatArray) -> FloatArray:
    """Typical sizes of m5…m11: what moves the phase by about a turn within ``world`` (n, 3)."""
    reach = float(np.abs(world).max()) + 1.0
    turns = abs(float(matrix[0, 3])) + 1.0
    return np.array([turns / reach] * 3 + [turns] + [1.0 / reach] * 3)


def phase_at_mark(unwrapped_phase: AnyArray, centre: FloatArray, semi_axes: FloatArray, *, usable: BoolArray) -> float:
    """Phase at a dark mark's centre from a ring around it: a robust quadratic in pixels; NaN if too little is seen.

    ``usable`` (y, x) leaves out what is not measured or lies on the other slope.
    """
    height, width = unwrapped_phase.shape
    reach = 2.3 * float(semi_axes[0]) + 2.0
    left, right = max(0, int(centre[0] - reach)), min(width, int(centre[0] + reach) + 2)
    top, bottom = max(0, int(centre[1] - reach)), min(height, int(centre[1] + reach) + 2)
    y, x = np.mgrid[top:bottom, left:right]
    distance = np.hypot(x - centre[0], y - centre[1])
    window = np.asarray(unwrapped_phase[top:bottom, left:right], dtype=np.float64)
    ring = (distance > 1.2 * semi_axes[0] + 1.0) & (distance < reach) & usable[top:bottom, left:right]
    ring &= np.isfinite(window)
    if ring.sum() < 24:
        return float("nan")
    dx, dy = (x[ring] - centre[0]) / reach, (y[ring] - centre[1]) / reach
    design = np.column_stack([np.ones(dx.size), dx, dy, dx * dx, dx * dy, dy * dy])
    values = window[ring]
    weight = np.ones(values.size)
    for _ in range(4):
        solution = np.linalg.lstsq(design * weight[:, None], values * weight, rcond=None)[0]
        residual = np.abs(values - design @ solution)
        weight = 1.0 / np.sqrt(1.0 + (residual / (2.0 * float(np.median(residual)) + 1e-6)) ** 2)
    return float(solution[0])


def _linear_start(world: FloatArray, unwrapped_phase: FloatArray) -> FloatArray:
    """Linear solution of the points, those that disagree weighted down in turns (a wrong order is a whole 2π off)."""
    value = unwrapped_phase / (2.0 * np.pi)
    mean, spread = world.mean(axis=0), float(world.std()) or 1.0
    middle, turns = float(np.median(value)), float(np.std(value)) or 1.0
    points = np.column_stack([(world - mean) / spread, np.ones(len(world))])
    rows = np.hstack([points, -((value - middle) / turns)[:, None] * points])
    weight = np.ones(len(rows))
    for _ in range(12):
        vector = np.linalg.svd(rows * weight[:, None], full_matrices=False)[2][-1]
        bottom = points @ vector[4:]
        error = np.abs(rows @ vector / np.where(np.abs(bottom) < 1e-9, 1e-9, bottom))
        weight = 1.0 / np.abs(bottom) / np.sqrt(1.0 + (error / (2.0 * float(np.median(error)) + 1e-9)) ** 2)
        weight /= weight.max()
    top, bottom_row = vector[:4] * turns + vector[4:] * middle, vector[4:]
    to_mean = np.eye(4)
    to_mean[:3, :3] /= spread
    to_mean[:3, 3] = -mean / spread
    matrix: FloatArray = np.vstack([top, bottom_row]) @ to_mean
    matrix /= matrix[1, 3]
    return matrix


def _agreeing(residual: FloatArray, gate: float) -> BoolArray:
    """Points within ``gate`` robust standard deviations of the median residual, seven at least."""
    middle = float(np.median(residual))
    deviation = np.abs(residual - middle)
    limit = max(gate * 1.4826 * float(np.median(deviation)), 1e-9)
    limit = max(limit, float(np.sort(deviation)[min(MIN_POINTS + 1, deviation.size - 1)]))
    agreeing: BoolArray = deviation <= limit
    return agreeing
