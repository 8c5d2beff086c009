"""The projector at the slide's first stop: world mm → Φ0/2π, a (2, 4) matrix as the projector's own.

At the first stop the stripes run along the epipolar lines, so Φ0 says where across the field the light passes: it is
what a calibration and a scan of the same rig have in common whatever stands before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.derivatives import forward_differences
from rahas.kernels.hold_fit import HoldFit, HoldPixels, hold_step
from rahas.kernels.projector import fit_projector, projector_from_parameters, projector_scale
from rahas.kernels.projector_lens import Lens, phase_through_lens
from rahas.typing import FloatArray

_ROUNDS = 8
_STILL_RAD = 1e-5
MIN_CONTRAST = 0.3
"""Modulation of the hold over that of the scan, below which the fit has not found the stripes."""


class FirstStopFit(NamedTuple):
    """The projector at the first stop."""

    matrix: FloatArray
    """(2, 4), m12 = 1."""
    covariance: FloatArray
    """(7, 7) of m5…m11, the camera taken as known."""
    residual_std: float
    """Of the image, robust, over the modulation."""


def fit_first_stop(pixels: HoldPixels, world: FloatArray, start_phase: FloatArray, lens: Lens) -> FirstStopFit:
    """Fit the matrix to the first hold's image at points of known place.

    ``world`` (n, 3) mm; ``start_phase`` (n,) rad, right to half a radian but for whole turns common to all.

    Raises
    ------
    ValueError
        Too few pixels, or the image does not show the stripes.
    """
    matrix = fit_projector(world, start_phase, gate=6.0, lens=lens).matrix
    scale = projector_scale(matrix, world)
    fit: HoldFit | None = None
    for _ in range(_ROUNDS):
        phase = phase_through_lens(matrix, lens, world)
        values = matrix.ravel()[:7]
        columns = forward_differences(
            lambda p: phase_through_lens(projector_from_parameters(p), lens, world), values, scale
        )
        fit = hold_step(pixels, phase, columns)
        matrix = projector_from_parameters(values + fit.change)
        if float(np.abs(columns @ fit.change).max()) < _STILL_RAD:
            break
    if fit is None or fit.contrast < MIN_CONTRAST:
        raise ValueError("the first hold does not show the scan's stripes")
    return FirstStopFit(matrix, fit.covariance, fit.residual_std)


class PhaseChange(NamedTuple):
    """How the pattern of a first hold lies beside where another says, as low-order terms over the image."""

    terms: FloatArray
    """(p,) radians."""
    covariance: FloatArray
    """(p, p)."""
    contrast: float
    residual_std: float


def fit_phase_change(pixels: HoldPixels, expected: FloatArray, columns: FloatArray, start: FloatArray) -> PhaseChange:
    """Measured minus ``expected`` phase (n,) rad as columns·terms, ``columns`` (n, p), from ``start`` (p,).

    Raises
    ------
    ValueError
        Too few pixels, or the image does not show the stripes.
    """
    terms, fit = start, None
    for _ in range(_ROUNDS):
        fit = hold_step(pixels, expected + columns @ terms, columns)
        terms = terms + fit.change
        if float(np.abs(columns @ fit.change).max()) < _STILL_RAD:
            break
    if fit is None or fit.contrast < MIN_CONTRAST:
        raise ValueError("the first hold does not show the scan's stripes")
    return PhaseChange(terms, fit.covariance, fit.contrast, fit.residual_std)
