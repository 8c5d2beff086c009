"""The joint solve of scans of any length: some hundred frames together, every other frame against what they say.

The joint solve's normal matrix grows with the square of the frames. Past some hundred of them the pixels' own phase is
known far better than one frame's step, so a further frame loses nothing by being solved alone.
"""

from __future__ import annotations

import numpy as np

from rahas.kernels.displacement import Slopes, frame_slopes
from rahas.kernels.joint_steps import DEGREE, OUTLIER_SIGMAS, StepField, levelled
from rahas.kernels.pixel_fit import PixelFit, fit_pixels_of
from rahas.kernels.step_choice import solve_chosen_steps
from rahas.kernels.waveform import waveform_of
from rahas.typing import AnyArray, BoolArray, FloatArray

MOST_FRAMES = 400
HELD_FRAMES = 12
CHUNK = 64  # frames
ROUNDS = 5


def solve_scan_steps(
    levels: AnyArray, unwrapped: FloatArray, across: FloatArray, steps: FloatArray, held: BoolArray, slopes: Slopes
) -> StepField:
    """As :func:`rahas.kernels.step_choice.solve_chosen_steps`, with memory that grows only with the frames.

    In the frames ``held`` (frame,) the step is zero by definition.
    """
    steps = np.where(held, 0.0, steps)
    if len(steps) <= MOST_FRAMES:
        return solve_chosen_steps(levels, unwrapped, across, steps, held, slopes)
    moving = np.flatnonzero(~held)
    thinned = moving[np.linspace(0, len(moving) - 1, MOST_FRAMES - HELD_FRAMES).astype(int)]
    together = np.union1d(np.flatnonzero(held)[-HELD_FRAMES:], thinned)
    field = solve_chosen_steps(levels[together], unwrapped, across, steps[together], held[together], slopes)
    return _with_all_frames(field, together, np.asarray(levels), unwrapped, across, steps, held, slopes)


def _with_all_frames(
    field: StepField,
    together: AnyArray,
    levels: AnyArray,
    unwrapped: FloatArray,
    across: FloatArray,
    steps: FloatArray,
    held: BoolArray,
    slopes: Slopes,
) -> StepField:
    own = _pixels(field, levels[together], unwrapped, across, slopes)
    kappa = field.waveform.at(own.background, own.modulation)
    basis = field.basis(unwrapped, across).astype(np.float32)
    number = np.arange(len(steps))
    terms = DEGREE + 1
    found = np.empty((len(steps), terms + 4))
    near = np.column_stack([field.coefficients, field.gain, field.offset, field.shift])
    near[:, 0] -= steps[together]
    for term in range(found.shape[1]):
        found[:, term] = np.interp(number, together, near[:, term])
    found[:, 0] += steps
    shifting = bool(field.shift.any())
    for start in range(0, len(steps), CHUNK):
        part = slice(start, start + CHUNK)
        seen = slopes if shifting else None
        found[part] = _each_alone(found[part], levels[part], own, kappa, basis, field.noise, seen)
    found[together] = np.column_stack([field.coefficients, field.gain, field.offset, field.shift])
    found[held, :terms] = 0.0
    return field._replace(
        coefficients=found[:, :terms], gain=found[:, terms], offset=found[:, terms + 1], shift=found[:, terms + 2 :]
    )


def _pixels(field: StepField, levels: AnyArray, unwrapped: FloatArray, across: FloatArray, slopes: Slopes) -> PixelFit:
    """The pixels' own phase, background and modulation, from the frames solved together."""
    delta = field.steps_at(unwrapped, across).astype(np.float32)
    flat = levelled(np.asarray(levels, np.float32), field)
    if field.shift.any():
        for columns, shift in zip(frame_slopes(delta, slopes.images), field.shift.T, strict=True):
            flat = flat - columns * shift[:, None].astype(np.float32)
    return fit_pixels_of(field.waveform, flat, unwrapped, delta)


def _each_alone(
    start: FloatArray,
    levels: AnyArray,
    own: PixelFit,
    kappa: AnyArray,
    basis: FloatArray,
    noise: float,
    slopes: Slopes | None,
) -> FloatArray:
    """Gauss–Newton on each frame's own unknowns (frame, term): steps, gain, offset and, with ``slopes``, the shift."""
    found = start.copy()
    terms = DEGREE + 1
    count = terms + (2 if slopes is None else 4)
    for _ in range(ROUNDS):
        delta = (found[:, :terms] @ basis).astype(np.float32)
        value, slope = waveform_of(own.phase + delta, kappa)
        seen = own.background + own.modulation * value
        gain = found[:, terms, None]
        columns = [gain * own.modulation * slope * polynomial for polynomial in basis]
        columns += [seen, np.ones_like(seen)]
        if slopes is not None:
            moved = frame_slopes(delta, slopes.images)
            seen = seen + np.einsum("fk,kfp->fp", found[:, terms + 2 :], moved)
            columns += [gain * m for m in moved]
        residual = levels - gain * seen - found[:, terms + 1, None]
        jacobian = np.stack(columns, axis=-1)
        scale = np.maximum(noise, 1.4826 * np.median(np.abs(residual), axis=1, keepdims=True))
        weighted = jacobian * (np.abs(residual) < OUTLIER_SIGMAS * scale)[..., None]
        normal = np.einsum("fpi,fpj->fij", weighted, jacobian)
        normal += 1e-6 * np.einsum("fii->f", normal)[:, None, None] / count * np.eye(count)
        change = np.linalg.solve(normal, np.einsum("fpi,fp->fi", weighted, residual)[..., None])[..., 0]
        found[:, :count] += change
    return found
