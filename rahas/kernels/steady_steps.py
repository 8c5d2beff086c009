"""The joint solve, with the object's displacement in it where there is one to be seen."""

from __future__ import annotations

import numpy as np

from rahas.kernels.displacement import Slopes, displacements_in, frame_slopes
from rahas.kernels.joint_steps import StepField, frame_columns, levelled, solve_joint_steps
from rahas.kernels.pixel_fit import fit_pixels
from rahas.typing import AnyArray, BoolArray, FloatArray

SEEN_PX = 0.03  # rms displacement that is worth undoing
SEEN_SIGMAS = 2.0  # and how far above its standard deviation it must be


def solve_steady_steps(
    levels: AnyArray, unwrapped: FloatArray, steps: FloatArray, held: BoolArray, slopes: Slopes
) -> StepField:
    """As :func:`solve_joint_steps`; ``shift`` is zero throughout unless the object was clearly displaced."""
    still = solve_joint_steps(levels, unwrapped, steps, held)
    delta = still.steps_at(unwrapped).astype(np.float32)
    flat = levelled(np.asarray(levels, np.float32), still)
    own = fit_pixels(flat, unwrapped, delta, np.zeros((len(still.waveform.constant), 1)), rounds=1)
    own = fit_pixels(flat, own.phase, delta, still.waveform.at(own.background, own.modulation), rounds=1)
    good = np.abs(own.residual).max(axis=0) < 2.0 * np.median(np.abs(own.residual).max(axis=0))
    basis = still.basis(unwrapped).astype(np.float32)[:, good]
    columns = frame_columns(own.only(good), basis, held)
    found = displacements_in(own.residual[:, good], columns, frame_slopes(delta[:, good], slopes.images[..., good]))
    size, doubt = (float(np.sqrt(np.mean(np.square(part)))) for part in found)
    if size < max(SEEN_PX, SEEN_SIGMAS * doubt):
        return still
    return solve_joint_steps(levels, unwrapped, still.coefficients[:, 0], held, slopes=slopes.images)
