"""The factor on the phase's standard deviation, against noise of known memory."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.noise_memory import phase_std_inflation
from rahas.typing import FloatArray


def fitted(noise: FloatArray, step: float) -> tuple[float, float]:
    """(stated factor, true factor) for frames with this noise (frame, pixel) at even steps."""
    frames, pixels = noise.shape
    phase = np.random.default_rng(2).uniform(-np.pi, np.pi, pixels)
    t = phase + step * np.arange(frames)[:, None]
    value, slope = np.cos(t), -np.sin(t)
    columns = np.stack([np.ones_like(value), value, slope], axis=-1).transpose(1, 0, 2)
    inverse = np.linalg.inv(columns.transpose(0, 2, 1) @ columns)
    found = np.einsum("pij,pnj,np->pi", inverse, columns, noise)
    residual = noise - np.einsum("pni,pi->np", columns, found)
    white = np.sqrt(inverse[:, 2, 2] * np.square(residual).sum(axis=0) / (frames - 3))
    return phase_std_inflation(residual, value, slope), float(np.std(found[:, 2] / white))


@pytest.mark.parametrize("frames", [60, 120])
def test_white_noise_is_left_alone(frames: int) -> None:
    noise = np.random.default_rng(3).normal(size=(frames, 3000))
    stated, true = fitted(noise, 2 * np.pi * 1.6 / frames)
    assert true == pytest.approx(1.0, abs=0.05)
    assert 1.0 <= stated <= 1.06


@pytest.mark.parametrize("memory", [0.3, 0.6])
def test_noise_that_lasts_over_frames(memory: float) -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(size=(128, 3000))
    for n in range(1, len(noise)):
        noise[n] = memory * noise[n - 1] + np.sqrt(1 - memory**2) * noise[n]
    stated, true = fitted(noise, 2 * np.pi * 1.6 / len(noise))
    assert true > 1.3
    assert 0.85 * true <= stated <= 1.1 * true


def test_too_few_frames_to_tell() -> None:
    assert phase_std_inflation(*(np.random.default_rng(5).normal(size=(3, 20, 50)))) == 1.0
