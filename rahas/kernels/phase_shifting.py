"""Phase from shifted frames: I_n = a + b·cos(φ + δ_n), linear in (a, b cos φ, −b sin φ) once the steps δ_n are known.

Both solvers are linear in the frames, so each is a 3 × N matrix of weights per frame, and one pass over the frames
with :class:`HarmonicSums` gives every pixel's phase, however many frames there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray

TURN = 2.0 * np.pi


class FringeMaps(NamedTuple):
    """What a pixel's frames say about it."""

    wrapped_phase: Float32Array  # (y, x), radians in [−π, π)
    background: Float32Array  # (y, x), a, grey levels
    modulation: Float32Array  # (y, x), b, grey levels
    phase_std: Float32Array  # (y, x), radians, from the residuals of the same frames
    residual_std: Float32Array  # (y, x), grey levels


def wrap(phase: AnyArray) -> AnyArray:
    """Phase brought to [−π, π).

    >>> float(wrap(np.array(3 * np.pi)) + np.pi)
    0.0
    """
    wrapped = (phase + np.pi) % TURN - np.pi
    return np.where(wrapped >= np.pi, -np.pi, wrapped)  # rounding may give +π itself


def weights_of_even_resampling(steps: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Weights that resample to even steps over the first period and sum up (thesis 3.15–3.19).

    Parameters
    ----------
    steps
        (frame,), radians, 0 at the first frame; one period at least.

    Returns
    -------
    weights
        (3, frame): rows give Σ I_int/N, 2/N·Σ I_int·cos θ and 2/N·Σ I_int·sin θ.
    used
        (frame,), which frames have any weight.

    Raises
    ------
    ValueError
        The steps span less than a period.
    """
    direction = 1.0 if steps[np.argmax(np.abs(steps))] >= 0 else -1.0
    travelled = np.maximum.accumulate(direction * steps)
    if travelled[-1] < TURN * 0.999:
        raise ValueError(f"steps span {travelled[-1] / TURN:.2f} period, expected at least 1")
    count = int(np.searchsorted(travelled, TURN))
    wanted = TURN * np.arange(count) / count
    upper = np.clip(np.searchsorted(travelled, wanted, side="right"), 1, len(steps) - 1)
    lower = upper - 1
    gap = travelled[upper] - travelled[lower]
    alpha = np.where(gap > 0, (travelled[upper] - wanted) / np.where(gap > 0, gap, 1.0), 1.0)  # eq. 3.16
    weights = np.zeros((3, len(steps)))
    basis = np.stack([np.ones(count), 2.0 * np.cos(direction * wanted), 2.0 * np.sin(direction * wanted)]) / count
    for row in range(3):
        np.add.at(weights[row], lower, basis[row] * alpha)  # eq. 3.17
        np.add.at(weights[row], upper, basis[row] * (1.0 - alpha))
    return weights, np.any(weights != 0.0, axis=0)


def weights_of_least_squares(steps: FloatArray) -> FloatArray:
    """Weights of the least-squares fit of a, b cos φ, −b sin φ to frames at uneven steps. (frame,) → (3, frame).

    Raises
    ------
    ValueError
        The steps do not determine the three unknowns.
    """
    design = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], axis=1)
    if np.linalg.cond(design) > 1e4:
        raise ValueError(f"steps between {steps.min():.3f} and {steps.max():.3f} rad do not determine a phase")
    return np.linalg.pinv(design)


class HarmonicSums:
    """Accumulates frames, block by block, into the maps of the field; memory does not grow with their number."""

    def __init__(self, shape: tuple[int, int], steps: FloatArray, weights: FloatArray) -> None:
        """``steps`` and ``weights`` (3, frame) are those of all the frames that will be added, in order."""
        self._design = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)]).astype(np.float32)
        self._weights = weights.astype(np.float32)
        self._shape = shape
        self._solution = np.zeros((3, shape[0] * shape[1]), np.float32)
        self._right_side = np.zeros((3, shape[0] * shape[1]), np.float64)
        self._squares = np.zeros(shape[0] * shape[1], np.float64)
        self._next = 0

    def add(self, block: AnyArray) -> None:
        """Add frames (n, y, x)."""
        here = slice(self._next, self._next + len(block))
        pixels = block.reshape(len(block), -1).astype(np.float32)
        self._solution += self._weights[:, here] @ pixels
        self._right_side += self._design[:, here] @ pixels
        self._squares += np.einsum("np,np->p", pixels, pixels)
        self._next = here.stop

    def maps(self) -> FringeMaps:
        """The maps of all frames added."""
        if self._next != self._design.shape[1]:
            raise ValueError(f"{self._next = } frames were added, expected {self._design.shape[1]}")
        background, cosine, sine = (m.reshape(self._shape) for m in self._solution)
        modulation = np.hypot(cosine, sine)
        # cos(φ + δ) = cos φ cos δ − sin φ sin δ, so the sine coefficient is −b sin φ (thesis 3.18)
        wrapped = wrap(np.arctan2(-sine, cosine))
        design = self._design.astype(np.float64)
        inverse = np.linalg.inv(design @ design.T)
        explained = np.einsum("ip,ij,jp->p", self._right_side, inverse, self._right_side)
        freedom = max(1, self._next - 3)
        residual_std = np.sqrt(np.maximum(self._squares - explained, 0.0) / freedom).reshape(self._shape)
        # variance of φ from the covariance of the two harmonic coefficients, projected across the phasor
        across = np.stack([np.zeros_like(cosine), -sine, cosine]) / np.maximum(modulation, 1e-6)
        spread = np.sqrt(np.einsum("iyx,ij,jyx->yx", across, inverse, across))
        with np.errstate(divide="ignore"):
            phase_std = residual_std * spread / modulation
        return FringeMaps(
            wrapped.astype(np.float32),
            background.astype(np.float32),
            modulation.astype(np.float32),
            phase_std.astype(np.float32),
            residual_std.astype(np.float32),
        )
