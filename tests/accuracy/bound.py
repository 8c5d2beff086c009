"""The Cramér–Rao bound of a capture's phase: what no estimator can beat, from the noise that the renderer put in."""

from __future__ import annotations

import numpy as np

from rahas.simulate.sensor import FULL_SCALE, LEVELS, code_table
from rahas.simulate.specs import CameraSpec
from rahas.typing import AnyArray, FloatArray

QUANTISATION = 1.0 / 12.0  # variance of rounding, in codes²


def noise_of_code(camera: CameraSpec) -> tuple[FloatArray, FloatArray]:
    """Mean code and the standard deviation of a code, at each light level: (level,), (level,)."""
    light = (np.arange(LEVELS) + 0.5) * (FULL_SCALE / LEVELS)
    smooth = np.convolve(np.pad(code_table(camera).astype(float), 200, mode="edge"), np.ones(401) / 401, mode="valid")
    slope = np.gradient(smooth, light)
    deviation = np.sqrt(camera.shot_noise * light + camera.read_noise**2)
    return smooth, np.sqrt((slope * deviation) ** 2 + QUANTISATION)


def phase_bound(
    *,
    background: FloatArray,
    modulation: FloatArray,
    phase: FloatArray,
    steps: FloatArray,
    camera: CameraSpec,
) -> FloatArray:
    """Bound of the phase's standard deviation, with background and modulation unknown too.

    Parameters
    ----------
    background, modulation, phase
        (pixel,): codes, codes, radians.
    steps
        (frame, pixel) or (frame, 1), radians.
    camera
        Its noise.

    Returns
    -------
    std
        (pixel,), radians.
    """
    t = phase + steps
    levels = background + modulation * np.cos(t)
    codes, deviation = noise_of_code(camera)
    sigma = np.interp(levels, codes, deviation)
    columns = np.stack([np.ones_like(t), np.cos(t), -modulation * np.sin(t)], axis=-1)
    information = np.einsum("npi,npj,np->pij", columns, columns, 1.0 / sigma**2)
    return np.sqrt(np.linalg.inv(information)[:, 2, 2])


def ripple(error: AnyArray, phase: AnyArray, orders: tuple[int, ...] = (1, 2, 3, 4)) -> list[float]:
    """Amplitude of the phase error at each order of the phase, radians."""
    return [float(2.0 * abs(np.mean(error * np.exp(-1j * k * phase)))) for k in orders]
