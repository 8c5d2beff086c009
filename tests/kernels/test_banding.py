"""Debanding takes what repeats with the phase, and leaves relief alone."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.banding import deband, measure_banding
from tests.roof_scene import camera_at, projector_above, see_relief

CAMERA, PROJECTOR = camera_at(), projector_above()
TRUTH = see_relief(CAMERA, PROJECTOR).unwrapped_phase


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean((values - np.nanmedian(values)) ** 2)))


def test_relief_without_ripple_is_left_as_it_is() -> None:
    noisy = TRUTH + np.random.default_rng(1).normal(0, 0.02, TRUTH.shape)
    result = deband(noisy)
    assert rms(result.unwrapped_phase - noisy) < 0.004
    assert result.ripple_before.max() < 0.02


@pytest.mark.parametrize("blanked", [False, True])
def test_ripple_is_taken_away(blanked: bool) -> None:
    rng = np.random.default_rng(2)
    place = (TRUTH - TRUTH.mean()) / np.ptp(TRUTH) * 2
    ripple = 0.05 * (1 + 0.5 * place) * np.cos(TRUTH + 0.4) + 0.02 * np.sin(2 * TRUTH)
    seen = TRUTH + ripple + rng.normal(0, 0.02, TRUTH.shape)
    if blanked:  # as the thesis blanks the pixels at every snake
        seen[np.abs((seen + np.pi) % (2 * np.pi) - np.pi) < 0.5] = np.nan
    result = deband(seen)
    assert 0.045 < result.ripple_before[0] < 0.065
    assert 0.012 < result.ripple_before[1] < 0.028
    assert {1, 2} <= set(result.orders_removed)
    left = rms(result.unwrapped_phase - TRUTH)
    assert left < 0.0235, "noise of 20 mrad and what relief passes for ripple"
    assert left > 0.019
    assert result.ripple_after[:2].max() < 0.006


def test_too_little_phase_is_no_banding() -> None:
    assert measure_banding(np.full((40, 50), np.nan)) is None
    flat = np.full((40, 50), 3.0)
    np.testing.assert_array_equal(deband(flat).unwrapped_phase, flat)


def test_ridges_along_the_stripes_are_no_ripple() -> None:
    """They are the same in every strip of columns, but in two zones of phase only."""
    y, x = np.mgrid[:240, :320].astype(float)
    level = y + x * 20.7 / 190
    ridges = 0.06 * np.exp(-0.5 * ((level - 150) / 6) ** 2) + 0.03 * np.exp(-0.5 * ((level - 71) / 6) ** 2)
    phase = 2 * np.pi * level / 20.7 + ridges + np.random.default_rng(4).normal(0, 0.03, y.shape)
    result = deband(phase)
    assert result.orders_removed == ()
    assert 0.0005 < result.ripple_before[0] < 0.003
    assert result.ripple_std[0] > 0.5 * result.ripple_before[0]
