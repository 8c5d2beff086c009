"""Noise of one frame by grey level."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.noise import NoiseCurve, combined_noise, noise_from_differences, noise_from_residual

TOP = 255.0


def frames(count: int, *, read: float = 1.5, shot: float = 0.04, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A ramp of light from 4 to 200 grey levels, rounded; its true noise (x,)."""
    level = np.linspace(4.0, 200.0, 400)
    sigma = np.sqrt(read**2 + shot * level)
    rng = np.random.default_rng(seed)
    stack = level + sigma * rng.standard_normal((count, 100, 400))
    return np.round(stack), sigma


def from_pairs(stack: np.ndarray) -> NoiseCurve:
    first, second = stack[::2], stack[1::2]
    curve = noise_from_differences(second - first, (first + second) / 2, gain=2.0, top_level=TOP)
    assert curve is not None
    return curve


def test_noise_follows_the_level() -> None:
    stack, sigma = frames(8)
    level = np.linspace(4.0, 200.0, 400)
    assert from_pairs(stack).at(level) == pytest.approx(sigma, rel=0.10)


def test_flicker_a_repeated_frame_and_a_passing_hand_do_not_count() -> None:
    stack, sigma = frames(16)
    stack[1::2] *= 1.03
    stack[3] = stack[2]
    stack[5, :, :200] = 20.0
    level = np.linspace(10.0, 195.0, 50)
    expected = np.interp(level, np.linspace(4.0, 200.0, 400), sigma)
    assert from_pairs(stack).at(level) == pytest.approx(expected, rel=0.12)


def test_noise_is_never_below_rounding() -> None:
    stack, _ = frames(8, read=0.05, shot=0.0)
    assert from_pairs(stack).sigma == pytest.approx(np.sqrt(1 / 12), rel=0.25)


def test_no_two_different_frames() -> None:
    same = np.ones((3, 10, 10))
    assert noise_from_differences(same - same, same, gain=2.0, top_level=TOP) is None
    unknown = combined_noise(still=None, moving=None, residual=None, lit_level=50.0)
    assert unknown.at(np.array([10.0, 200.0])) == pytest.approx(np.sqrt(1 / 12), rel=1e-6)


def test_what_a_codec_froze_in_the_light_counts_in_the_dark_too() -> None:
    level = np.array([10.0, 100.0])
    frozen, shown = NoiseCurve(level, np.array([0.3, 0.3])), NoiseCurve(level, np.array([0.3, 1.5]))
    curve = combined_noise(still=frozen, moving=shown, residual=None, lit_level=100.0)
    assert curve.at(10.0) == pytest.approx(1.5, rel=0.03)
    honest = NoiseCurve(level, np.array([1.0, 1.5]))
    assert combined_noise(still=honest, moving=honest, residual=None, lit_level=100.0).at(10.0) == pytest.approx(1.0)


def test_residual_of_the_best_fitted_quarter() -> None:
    levels = np.full((100, 100), 50.0)
    residual = np.full((100, 100), 2.0)
    residual[:60] = 6.0
    curve = noise_from_residual(residual, levels, top_level=TOP)
    assert curve is not None
    assert curve.at(50.0) == pytest.approx(2.0)
