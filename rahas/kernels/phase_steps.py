"""Phase step of every frame by the advanced iterative algorithm (Wang & Han, Opt. Lett. 29:1671, 2004).

A frame n of the scan shows I_pn = g_n·a_p + o_n + b_p·cos(Φ_p + δ_n). Alternately, the phase step δ_n of each frame is
a linear least-squares fit over pixels, and background a, modulation b and phase Φ of each pixel one over frames. One
step a frame, not one a pixel: a projector that tilts needs more (the step varies over the field); weights that are even
about a point give the step at that point.

Frames in which the pattern hardly moved say little new: they are weighted down, so that a long hold does not outweigh
the scan (and a stall, a doubled frame or a slip back are harmless).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.frame_blocks import frame_blocks
from rahas.typing import Float32Array, FloatArray, FrameStack


class PhaseSteps(NamedTuple):
    """Steps of the frames and the pixels' fit."""

    step: FloatArray
    """(frame) phase step, radians, unwrapped over the frames: frame n shows cos(Φ + step)."""
    background: Float32Array
    """(pixel) a."""
    modulation: Float32Array
    """(pixel) b ≥ 0."""
    wrapped_phase: Float32Array
    """(pixel) Φ in [-π, π)."""
    residual: float
    """Weighted rms of what the fit leaves, in the samples' units."""


class ScanPattern(NamedTuple):
    """Fit of every pixel of the field to known steps, (y, x)."""

    background: Float32Array
    modulation: Float32Array
    wrapped_phase: Float32Array


def advanced_iterative_steps(
    samples: Float32Array, weight: Float32Array, *, start: FloatArray, iterations: int = 12, tolerance: float = 1e-4
) -> PhaseSteps:
    """Phase steps of a scan from its pixels.

    Parameters
    ----------
    samples
        (frame, pixel) grey levels.
    weight
        (pixel) weight in the frames' fits, ≥ 0.
    start
        (frame) rough steps, radians, of the right sign: the fit is blind to a common change of sign.
    iterations, tolerance
        It stops when no step moves by more than ``tolerance`` radians, and in any case after so many rounds.

    Returns
    -------
    PhaseSteps
        The zero of ``step`` is the start's (their mean difference is none); see :func:`with_zero_at`.
    """
    step: FloatArray = np.asarray(start, np.float64).copy()
    balanced: Float32Array = samples
    trust: Float32Array = weight.astype(np.float32)
    for _ in range(iterations):
        frame_weight = path_share(step)
        cosine, sine = np.cos(step), np.sin(step)
        background, in_phase, quadrature = _pixel_fit(balanced, cosine, sine, frame_weight)
        light, new_step = _frame_fit(samples, trust, background, in_phase, quadrature)
        balanced = samples - (light - background)
        new_step = np.unwrap(new_step)
        new_step -= float(np.average(new_step - step, weights=frame_weight))
        moved = float(np.abs(new_step - step).max())
        step = new_step
        fitted = background + _outer(np.cos(step), in_phase) - _outer(np.sin(step), quadrature)
        error = _mean_square(balanced - fitted, frame_weight)
        trust = weight / (1 + error / np.float32(max(float(np.median(error)) * 4, 1e-12)))
        if moved < tolerance:
            break
    return PhaseSteps(
        step=step,
        background=background,
        modulation=np.hypot(in_phase, quadrature),
        wrapped_phase=np.arctan2(quadrature, in_phase),
        residual=float(np.sqrt(np.average(error, weights=weight))),
    )


def pattern_from_steps(stack: FrameStack, step: FloatArray, *, first: int, scale: float = 1.0) -> ScanPattern:
    """Background, modulation and wrapped phase of every pixel, from frames of known ``step``, ``first`` onwards."""
    height, width = stack.shape[1:]
    share = path_share(step)
    basis = np.stack([np.ones_like(step), np.cos(step), -np.sin(step)])
    right = np.zeros((3, height * width))
    for frames, values in frame_blocks(stack, first=first, stop=first + len(step), scale=scale):
        part = slice(frames.start - first, frames.stop - first)
        right += (basis[:, part] * share[part]).astype(np.float32) @ values.reshape(len(values), -1)
    background, in_phase, quadrature = np.linalg.solve((basis * share) @ basis.T, right).astype(np.float32)
    shape = (height, width)
    return ScanPattern(
        background.reshape(shape),
        np.hypot(in_phase, quadrature).reshape(shape),
        np.arctan2(quadrature, in_phase).reshape(shape),
    )


def with_zero_at(step: FloatArray, frames: slice) -> FloatArray:
    """``step`` with its zero (the gauge) at the mean of ``frames``, the hold before the scan."""
    return step - step[frames].mean()


def path_share(step: FloatArray) -> FloatArray:
    """(frame) weight by the pattern's path about the frame, capped; all frames of holds together weigh a tenth."""
    path = np.abs(np.gradient(step)) if len(step) > 1 else np.ones(1)
    if not path.any():
        return np.ones_like(path)
    share = np.minimum(path * path.sum() / (path**2).sum(), 1.0)
    return np.maximum(share, min(0.02, 0.1 * float(share.mean())))


def _pixel_fit(
    samples: Float32Array, cosine: FloatArray, sine: FloatArray, frame_weight: FloatArray
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Background, b·cos Φ and b·sin Φ of each pixel: I = a + b cos Φ·cos δ − b sin Φ·sin δ."""
    basis = np.stack([np.ones_like(cosine), cosine, -sine])
    weighted = basis * frame_weight
    normal = weighted @ basis.T
    background, in_phase, quadrature = np.linalg.solve(normal, weighted.astype(np.float32) @ samples).astype(np.float32)
    return background, in_phase, quadrature


def _frame_fit(
    samples: Float32Array,
    weight: Float32Array,
    background: Float32Array,
    in_phase: Float32Array,
    quadrature: Float32Array,
) -> tuple[Float32Array, FloatArray]:
    """Background light g·a + o of each frame, (frame, pixel), and its step; the steps do not depend on the gain."""
    level = np.average(background, weights=weight)
    basis = np.stack([np.ones_like(background), background - level, in_phase, -quadrature])
    weighted = basis * weight
    normal = (weighted @ basis.T).astype(np.float64)
    normal[1, 1] += (
        1e-3 * float(weight @ np.square(background)) + 1e-9
    )  # an even background tells no gain from an offset
    aim = weighted @ samples.T.astype(np.float32)
    aim[1] += 1e-3 * float(weight @ np.square(background))  # ... then the gain is 1
    share = np.linalg.solve(normal, aim.astype(np.float64))
    light = (basis[:2].T @ share[:2].astype(np.float32)).T
    return light, np.arctan2(share[3], share[2]).astype(np.float64)


def _mean_square(residual: Float32Array, frame_weight: FloatArray) -> Float32Array:
    """(pixel) weighted mean square over the frames."""
    share = (frame_weight / frame_weight.sum()).astype(np.float32)
    return np.asarray(share @ np.square(residual))


def _outer(frames: FloatArray, pixels: Float32Array) -> Float32Array:
    return np.asarray(np.multiply.outer(frames.astype(np.float32), pixels))
