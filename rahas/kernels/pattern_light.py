"""What light the moving pattern throws on each pixel: background and contrast, blind to how the pattern moves.

A capture dwells at its holds, so a plain mean over time keeps the stripes of the holds. Weighting each frame by how
far the pattern moved since the frame before makes it a mean along the pattern's path, in which stripes cancel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.frame_blocks import frame_blocks
from rahas.typing import Float32Array, FloatArray, FrameStack


class FrameChange(NamedTuple):
    """How much each frame differs from the one before."""

    rms: FloatArray
    """(frame) rms difference from the frame before, in the stack's units; the first frame has 0."""
    noise: float
    """Standard deviation of one pixel in one frame, from the quietest tenth of the frame pairs."""


class PatternLight(NamedTuple):
    """Mean and contrast of each pixel under the moving pattern, (y, x)."""

    background: Float32Array
    """Path-weighted mean over the frames."""
    contrast: Float32Array
    """Path-weighted standard deviation over the frames, noise taken out."""
    weight: Float32Array
    """0 … 1: how far the contrast stands above the noise and above the unlit parts of the field."""
    inverse: Float32Array
    """Regularised 1/contrast, by which a frame less its background becomes stripes of even strength."""


def frame_change(
    stack: FrameStack, *, scale: float = 1.0, weight: FloatArray | Float32Array | None = None
) -> FrameChange:
    """Root mean square difference between neighbouring frames, over pixels weighted by ``weight`` (y, x)."""
    count, height, width = stack.shape
    pixel_weight = np.ones(height * width, np.float32) if weight is None else weight.ravel().astype(np.float32)
    pixel_weight /= pixel_weight.sum()
    squares = np.zeros(count)
    previous: Float32Array | None = None
    for frames, values in frame_blocks(stack, scale=scale):
        before = values[:1] if previous is None else previous
        difference = np.diff(np.concatenate([before, values]), axis=0).reshape(len(values), -1)
        squares[frames] = np.square(difference, out=difference) @ pixel_weight
        previous = values[-1:]
    rms = np.sqrt(squares)
    return FrameChange(rms, quiet_noise(rms[1:]))


def quiet_noise(change_rms: FloatArray) -> float:
    """Standard deviation of one pixel, from the quietest tenth of the frame pairs (exact repeats left out)."""
    different = change_rms[change_rms > 0]
    return float(np.quantile(different, 0.1) / np.sqrt(2)) if different.size else 0.0


def path_weights(change: FrameChange) -> FloatArray:
    """(frame) weight by the pattern's path since the frame before; jumps of the lamp count no more than fast motion."""
    moved = np.sqrt(np.clip(change.rms**2 - 2 * change.noise**2, 0, None))
    return np.minimum(moved, np.quantile(moved, 0.85))


def pattern_light(stack: FrameStack, frame_weight: FloatArray, *, noise: float, scale: float = 1.0) -> PatternLight:
    """Background and contrast of every pixel; ``frame_weight`` (frame) is the pattern's path in each frame."""
    height, width = stack.shape[1:]
    total, squares = np.zeros(height * width), np.zeros(height * width)
    for frames, values in frame_blocks(stack, scale=scale):
        flat, weight = values.reshape(len(values), -1), frame_weight[frames].astype(np.float32)
        total += weight @ flat
        squares += weight @ np.square(flat)
    share = max(float(frame_weight.sum()), np.finfo(float).tiny)
    background = total / share
    variance = np.clip(squares / share - background**2 - noise**2, 0, None)
    return light_from_images(
        background=background.reshape(height, width),
        contrast=np.sqrt(variance).reshape(height, width),
        noise=noise,
    )


def light_from_images(*, background: FloatArray, contrast: FloatArray, noise: float) -> PatternLight:
    """Weights that follow from a contrast image: full where the pattern is strong, none in shadow and noise."""
    floor = float(np.max([0.2 * np.quantile(contrast, 0.95), 3 * noise, np.finfo(np.float32).tiny]))
    weight = (contrast**2 / (contrast**2 + floor**2)) ** 2
    inverse = contrast / (contrast**2 + floor**2)
    return PatternLight(*(image.astype(np.float32) for image in (background, contrast, weight, inverse)))
