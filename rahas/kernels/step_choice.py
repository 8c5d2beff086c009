"""The joint solve with as much in it as the frames ask for: a step that varies over the field, a moving object, or not.

What is not there costs accuracy when it is solved for: where few frames hold a strong second harmonic, errors of the
model leak into terms that the rig does not have.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.displacement import Slopes, displacements_in, frame_slopes
from rahas.kernels.joint_steps import StepField, frame_columns, levelled, solve_joint_steps
from rahas.kernels.pixel_fit import PixelFit, fit_pixels_of
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray

UNIFORM_LOSS = 0.125  # of the phase's noise variance, that a uniform step may cost
SEEN_PX = 0.03  # rms displacement that is worth undoing
SEEN_SIGMAS = 2.0  # and how far above its standard deviation it must be


class _Left(NamedTuple):
    """What a solved scan leaves of its frames."""

    own: PixelFit
    good: BoolArray  # (pixel,), those that follow
    delta: Float32Array  # (frame, pixel), radians

    def variance(self, good: BoolArray) -> float:
        """Mean squared residual of the pixels ``good``, grey levels²."""
        return float(np.mean(np.square(self.own.residual[:, good])))


def solve_chosen_steps(
    levels: AnyArray, unwrapped: FloatArray, across: FloatArray, steps: FloatArray, held: BoolArray, slopes: Slopes
) -> StepField:
    """As :func:`solve_joint_steps`, with one step for the whole field where a frame needs no more.

    ``shift`` is zero throughout unless the object was clearly displaced.
    """
    levels = np.asarray(levels, np.float32)
    field = solve_joint_steps(levels, unwrapped, steps, held, across=across)
    left = _left_by(field, levels, unwrapped, across)
    uniform = _is_almost_uniform(field, left, unwrapped)
    if uniform:
        plain = solve_joint_steps(levels, unwrapped, field.coefficients[:, 0], held, uniform=True)
        rest = _left_by(plain, levels, unwrapped, across)
        loss = rest.variance(left.good) / left.variance(left.good) - 1.0
        uniform = loss * len(steps) < UNIFORM_LOSS
        if uniform:
            field, left = plain, rest
    if not _is_displaced(left, field.basis(unwrapped, across), held, slopes):
        return field
    return solve_joint_steps(
        levels, unwrapped, field.coefficients[:, 0], held, across=across, slopes=slopes.images, uniform=uniform
    )


def _left_by(field: StepField, levels: FloatArray, unwrapped: FloatArray, across: FloatArray) -> _Left:
    delta = field.steps_at(unwrapped, across).astype(np.float32)
    flat = levelled(levels, field)
    own = fit_pixels_of(field.waveform, flat, unwrapped, delta)
    worst = np.abs(own.residual).max(axis=0)
    return _Left(own, worst < 2.0 * np.median(worst), delta)


def _is_almost_uniform(field: StepField, left: _Left, unwrapped: FloatArray) -> bool:
    """Whether a uniform step might do: a look that costs nothing."""
    beyond = field.coefficients[:, 1:] @ field.basis(unwrapped)[1:, left.good]
    modulation = np.median(left.own.modulation[left.good])
    signal = 0.5 * float(np.mean(np.square(beyond - beyond.mean(axis=0)))) * modulation**2
    return bool(len(beyond) * signal < 40.0 * UNIFORM_LOSS * left.variance(left.good))


def _is_displaced(left: _Left, basis: FloatArray, held: BoolArray, slopes: Slopes) -> bool:
    good = left.good
    columns = frame_columns(left.own.only(good), basis[:, good].astype(np.float32), held)
    derivatives = frame_slopes(left.delta[:, good], slopes.images[..., good])
    found = displacements_in(left.own.residual[:, good], columns, derivatives)
    size, doubt = (float(np.sqrt(np.mean(np.square(part)))) for part in found)
    return bool(size >= max(SEEN_PX, SEEN_SIGMAS * doubt))
