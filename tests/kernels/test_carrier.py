"""Small turns of the slide from the ramp along a hold's stripes."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.carrier import carrier_from_stripes, demodulate, ramp_slope


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("patch", [False, True])
def test_turn_off_a_stop(axis: int, patch: bool) -> None:
    """± 0.1° near the stop and 3 % further off, on the whole field and on a small object; the slide's centre is off."""
    rng = np.random.default_rng(7)
    height, width = 120, 160
    y, x = np.mgrid[:height, :width].astype(float)
    across, down = 0.6 * (x - 91), 0.55 * (y - 48)
    truth = np.array([0, 0, 0, 0.1, -0.3, 0.5, 1.0, -2.0, 4.0, 8.0])
    sine, cosine = (np.sin(np.radians(truth)), np.cos(np.radians(truth)))
    held, other = (across, down) if axis == 1 else (down, across)
    phase = held * cosine[:, None, None] + other * sine[:, None, None]
    lit = np.hypot(x - 80, y - 60) < 24 if patch else np.ones((height, width), bool)
    frames = (60 + 30 * np.cos(phase)) * lit + rng.normal(0, 1, phase.shape)
    background = (60.0 * lit).astype(np.float32)
    stack = np.round(64 * (frames + 20)).astype(np.uint16)
    carrier = carrier_from_stripes(stack[:3].mean(0) / 64 - 20 - background, axis=axis)
    sums = demodulate(stack, carrier, background=background + 20, first=0, stop=len(stack), scale=1 / 64)
    wave_number = 0.55 if axis == 1 else 0.6
    found = np.degrees(np.arcsin(ramp_slope(sums, held=slice(0, 3)) / wave_number))
    assert np.all(np.abs(found - truth) < 0.1 + 0.04 * np.abs(truth))
    assert carrier.wave_number == pytest.approx(0.6 if axis == 1 else 0.55, rel=0.05)
