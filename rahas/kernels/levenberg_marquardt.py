"""Small dense nonlinear least squares: Levenberg–Marquardt with a forward-difference Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rahas.typing import FloatArray

_MAX_DAMPING = 1e12


class LeastSquaresFit(NamedTuple):
    """Minimum of a sum of squares."""

    parameters: FloatArray
    """(p,) at the minimum."""
    residual: FloatArray
    """(n,) at the minimum, in the caller's unit."""
    normal_matrix: FloatArray
    """(p, p) JᵀJ at the minimum: its inverse is the covariance where residuals have unit variance."""


def minimise_squares(
    residual_of: Callable[[FloatArray], FloatArray], start: FloatArray, *, scale: FloatArray, max_iterations: int = 30
) -> LeastSquaresFit:
    """Minimise ``sum(residual_of(p)**2)`` from ``start``.

    ``scale`` (p,) is a typical size of each parameter: the finite-difference step is 1e-6 of it. Damping multiplies
    the diagonal of JᵀJ (Marquardt), so the units of the parameters do not matter.
    """
    parameters = np.array(start, dtype=np.float64)
    residual = residual_of(parameters)
    cost = float(residual @ residual)
    damping = 1e-4
    normal = np.zeros((parameters.size, parameters.size))
    for _ in range(max_iterations):
        jacobian = _jacobian(residual_of, parameters, residual, scale)
        normal = jacobian.T @ jacobian
        gradient = jacobian.T @ residual
        improved = False
        while damping < _MAX_DAMPING:
            damped = normal + damping * np.diag(np.diag(normal) + 1e-300)
            step = -np.linalg.lstsq(damped, gradient, rcond=None)[0]
            trial = residual_of(parameters + step)
            trial_cost = float(trial @ trial)
            if np.isfinite(trial_cost) and trial_cost <= cost:
                improved = cost - trial_cost > 1e-10 * cost
                parameters, residual, cost = parameters + step, trial, trial_cost
                damping = max(damping * 0.1, 1e-12)
                break
            damping *= 10.0
        if not improved:
            break
    jacobian = _jacobian(residual_of, parameters, residual, scale)
    return LeastSquaresFit(parameters, residual, jacobian.T @ jacobian)


def _jacobian(
    residual_of: Callable[[FloatArray], FloatArray], parameters: FloatArray, residual: FloatArray, scale: FloatArray
) -> FloatArray:
    jacobian = np.empty((residual.size, parameters.size))
    for index, size in enumerate(scale):
        step = 1e-6 * size
        moved = parameters.copy()
        moved[index] += step
        jacobian[:, index] = (residual_of(moved) - residual) / step
    return jacobian


def inverse_of_normal(normal: FloatArray) -> FloatArray:
    """Inverse of a normal matrix whose parameters have very different units (scaled to unit diagonal first)."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse: FloatArray = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-13, hermitian=True)
    rescaled: FloatArray = inverse / np.outer(size, size)
    return rescaled
