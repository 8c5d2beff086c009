"""Background and modulation of the moving stripes, pixel by pixel, from the frames of the scan.

Model of one pixel in frame n with phase step α_n: ``I_n = a + c1 cos α_n + s1 sin α_n (+ c2 cos 2α_n + s2 sin 2α_n)``;
modulation ``b = hypot(c1, s1)`` and wrapped phase ``φ = atan2(-s1, c1)``, so that ``I = a + b cos(φ + α)``.
The second harmonic (lamp, slide and camera gamma) is fitted where the scan is long enough to tell it apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, Float32Array, FloatArray

_ARC_FOR_HARMONIC_RAD = 0.85 * 2 * np.pi
_WORST_CONDITION = 200.0


class StripeFit(NamedTuple):
    """What the scan shows of each pixel."""

    background: Float32Array
    """a (y, x), grey levels: the scene without stripes."""
    modulation: Float32Array
    """b (y, x), grey levels."""
    wrapped_phase: Float32Array
    """φ (y, x) in [−π, π]."""
    residual: Float32Array
    """Standard deviation of a frame about the fit (y, x), grey levels."""


class StripeFitter:
    """Least squares of the stripe model over frames that come block by block; nothing but sums is kept."""

    def __init__(self, phase_step: FloatArray) -> None:
        """``phase_step``: α_n of all frames that will be added (frame,), radians."""
        arc = float(np.ptp(phase_step)) if phase_step.size else 0.0
        self._terms = 5 if arc >= _ARC_FOR_HARMONIC_RAD else 3
        self._normal = np.zeros((self._terms, self._terms))
        self._right: Float32Array | None = None
        self._squares: Float32Array | None = None
        self._frames = 0

    def add(self, frames: AnyArray, phase_step: FloatArray) -> None:
        """Add frames (frame, y, x) with their steps (frame,)."""
        design = self._design(phase_step)
        self._normal += design.T @ design
        flat = frames.reshape(len(frames), -1).astype(np.float32, copy=False)
        part = (design.T.astype(np.float32) @ flat).reshape(self._terms, *frames.shape[1:])
        squares = np.einsum("np,np->p", flat, flat).reshape(frames.shape[1:])
        self._right = part if self._right is None else self._right + part
        self._squares = squares if self._squares is None else self._squares + squares
        self._frames += len(frames)

    def solve(self) -> StripeFit | None:
        """The fit, or ``None`` when the stripes moved too little to tell background from modulation."""
        if self._right is None or self._squares is None or np.linalg.cond(self._normal) > _WORST_CONDITION:
            return None
        inverse = np.linalg.inv(self._normal).astype(np.float32)
        coefficients = np.tensordot(inverse, self._right, axes=1)
        spread = self._squares - np.einsum("kyx,kyx->yx", coefficients, self._right)
        residual = np.sqrt(np.maximum(spread, 0) / max(self._frames - self._terms, 1))
        background, cosine, sine = (np.ascontiguousarray(part) for part in coefficients[:3])
        return StripeFit(background, np.hypot(cosine, sine), np.arctan2(-sine, cosine), residual)

    def _design(self, phase_step: FloatArray) -> FloatArray:
        harmonics = [np.ones_like(phase_step)]
        for order in range(1, (self._terms - 1) // 2 + 1):
            harmonics += [np.cos(order * phase_step), np.sin(order * phase_step)]
        return np.stack(harmonics, axis=1)


def pitch_from_fit(fit: StripeFit) -> float:
    """Mean stripe pitch down the image in pixels of the fit, weighted by modulation; ``inf`` where none is seen."""
    shown = fit.modulation * np.exp(1j * fit.wrapped_phase)
    turn = np.angle(np.sum(shown[1:] * np.conj(shown[:-1])))
    return float(2 * np.pi / abs(turn)) if turn else float("inf")
