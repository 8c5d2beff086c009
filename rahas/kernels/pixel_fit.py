"""The pixels' own unknowns, background, modulation and phase, at known steps and a known waveform."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.waveform import Waveform, waveform_of
from rahas.typing import AnyArray, BoolArray, FloatArray


class PixelFit(NamedTuple):
    """What each pixel's frames say, and what they leave."""

    phase: FloatArray  # (pixel,), radians
    background: FloatArray  # (pixel,), grey levels
    modulation: FloatArray  # (pixel,), grey levels
    residual: FloatArray  # (frame, pixel), grey levels, orthogonal to 1, w and w′
    value: FloatArray  # (frame, pixel), w
    slope: FloatArray  # (frame, pixel), w′
    factor: FloatArray  # (pixel, 3, 3), inverse transposed Cholesky factor: [1, w, w′] @ factor is orthonormal

    def only(self, good: BoolArray | slice) -> PixelFit:
        """The fit of some pixels."""
        parts = {name: getattr(self, name)[..., good] for name in self._fields[:-1]}
        return PixelFit(**parts, factor=self.factor[good])

    @property
    def phase_variance(self) -> FloatArray:
        """(pixel,), variance of φ in units of the noise's variance."""
        return self.factor[:, 2, 2] ** 2 / self.modulation**2


def fit_pixels(
    levels: FloatArray,
    phase: FloatArray,
    delta: FloatArray,
    kappa: AnyArray,
    *,
    used: BoolArray | None = None,
    rounds: int = 2,
) -> PixelFit:
    """Gauss–Newton on a + b·w(φ + δ), from a rough phase.

    Parameters
    ----------
    levels, delta
        (frame, pixel): grey levels, and steps in radians.
    phase
        (pixel,), radians.
    kappa
        (harmonic, pixel), the waveform.
    used
        (frame, pixel), frames that count; all by default.
    """
    weight = None if used is None else used.astype(levels.dtype)
    phase = phase.astype(levels.dtype)
    for number in range(rounds + 1):
        value, slope = waveform_of(phase + delta, kappa)
        background, modulation, turned, factor = _three_unknowns(levels, value, slope, weight)
        if number < rounds:
            phase = phase + np.where(modulation > 0, np.arctan2(turned, modulation), 0.0)
    residual = levels - background - modulation * value - turned * slope
    if weight is not None:
        residual = residual * weight
    return PixelFit(phase, background, modulation, residual, value, slope, factor)


def fit_pixels_of(waveform: Waveform, levels: FloatArray, phase: FloatArray, delta: FloatArray) -> PixelFit:
    """As :func:`fit_pixels`, with the waveform that belongs to each pixel's own background and modulation.

    These two are biased until the waveform is right, and the waveform until they are: hence three fits.
    """
    own = fit_pixels(levels, phase, delta, waveform.constant[:, None], rounds=1)
    for _ in range(2):
        own = fit_pixels(levels, own.phase, delta, waveform.at(own.background, own.modulation), rounds=1)
    return own


def _three_unknowns(
    levels: FloatArray, value: FloatArray, slope: FloatArray, weight: FloatArray | None
) -> tuple[FloatArray, ...]:
    columns = (np.ones_like(value), value, slope)
    weighted = columns if weight is None else tuple(weight * c for c in columns)
    normal = np.empty((levels.shape[1], 3, 3))
    right = np.empty((levels.shape[1], 3))
    for i in range(3):
        right[:, i] = np.einsum("np,np->p", weighted[i], levels, dtype=float)
        for j in range(i, 3):
            normal[:, i, j] = normal[:, j, i] = np.einsum("np,np->p", weighted[i], columns[j])
    normal += 1e-4 * np.eye(3)  # a pixel without frames gets nothing
    factor = np.linalg.inv(np.linalg.cholesky(normal)).transpose(0, 2, 1)
    solution = np.einsum("pij,pkj,pk->pi", factor, factor, right).astype(levels.dtype)
    return solution[:, 0], solution[:, 1], solution[:, 2], factor
