"""Phase from shifted frames, even and uneven."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rahas.kernels.phase_shifting import HarmonicSums, weights_of_even_resampling, weights_of_least_squares, wrap


def _frames(phase: np.ndarray, steps: np.ndarray) -> np.ndarray:
    return 100.0 + 40.0 * np.cos(phase[None] + steps[:, None, None])


@given(st.lists(st.floats(-4, 4), min_size=5, max_size=40))
@settings(max_examples=50, deadline=None)
def test_least_squares_is_exact_at_any_steps(steps: list[float]) -> None:
    phase = np.linspace(-np.pi, 3.1, 12).reshape(3, 4)
    delta = np.array([0.0, 2.0, 4.0, *steps])
    sums = HarmonicSums(phase.shape, delta, weights_of_least_squares(delta))
    for frame in _frames(phase, delta):
        sums.add(frame[None])
    maps = sums.maps()
    assert np.abs(wrap(maps.wrapped_phase - phase)).max() < 1e-3
    assert np.abs(maps.modulation - 40.0).max() < 0.05
    assert np.abs(maps.background - 100.0).max() < 0.05


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_even_resampling_is_close_on_uneven_steps(direction: float) -> None:
    phase = np.linspace(-np.pi, 3.1, 60).reshape(6, 10)
    t = np.linspace(0, 1, 60)
    steps = direction * 2 * np.pi * 1.2 * (t + 0.08 * np.sin(2 * np.pi * t) ** 2)
    weights, used = weights_of_even_resampling(steps)
    assert 40 < used.sum() < 60
    sums = HarmonicSums(phase.shape, steps, weights)
    sums.add(_frames(phase, steps))
    error = wrap(sums.maps().wrapped_phase - phase)
    assert 0 < np.abs(error).max() < 0.01  # linear interpolation: close, not exact


def test_less_than_a_period_is_refused() -> None:
    with pytest.raises(ValueError, match="period"):
        weights_of_even_resampling(np.linspace(0, 6.0, 30))


def test_predicted_noise_is_true() -> None:
    rng = np.random.default_rng(0)
    phase = rng.uniform(-np.pi, np.pi, (60, 80))
    steps = np.sort(rng.uniform(0, 9, 50))
    sums = HarmonicSums(phase.shape, steps, weights_of_least_squares(steps))
    sums.add(_frames(phase, steps) + rng.normal(0, 2.0, (50, 60, 80)))
    maps = sums.maps()
    error = wrap(maps.wrapped_phase - phase)
    assert 0.95 < np.std(error) / np.sqrt(np.mean(maps.phase_std**2)) < 1.05


@given(st.floats(-1e3, 1e3))
def test_wrap_is_half_open(value: float) -> None:
    wrapped = float(wrap(np.array(value)))
    assert -np.pi <= wrapped < np.pi
    assert abs(np.sin(wrapped) - np.sin(value)) < 1e-9
