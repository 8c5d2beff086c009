"""Slide angle from structure tensors, against stripes of known angle."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.orientation import gradient_direction_deg, slide_angle_from_tensors, stripe_tensors

HEIGHT, WIDTH = 90, 120


def stripes_at(
    angle_deg: np.ndarray, *, mirrored: bool = False, tilt_deg: float = 0.0, relief: float = 0.0
) -> np.ndarray:
    """Rotating stripes (frame, y, x) on an oblique, uneven surface: 8-px pitch across, 10-px down."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    x, y = x - WIDTH / 2, y - HEIGHT / 2
    tilt = np.radians(tilt_deg)
    along, down = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
    first = 2 * np.pi * along / 8 * (1 + 0.05 * along / WIDTH)
    second = 2 * np.pi * down / 10 + relief * np.sin(x / 9) * np.cos(y / 11)
    if mirrored:
        first = -first
    theta = np.radians(angle_deg)[:, None, None]
    return np.cos(first * np.cos(theta) + second * np.sin(theta)).astype(np.float32)


@pytest.mark.parametrize(
    ("mirrored", "tilt_deg", "relief"), [(False, 0, 0), (True, 0, 0.8), (False, 8, 0.8), (True, -8, 0)]
)
def test_angle_of_every_frame(mirrored: bool, tilt_deg: float, relief: float) -> None:
    rng = np.random.default_rng(3)
    truth = np.concatenate([np.zeros(4), np.sort(rng.uniform(0, 90, 60)), np.full(4, 90.0)])
    stripes = stripes_at(truth, mirrored=mirrored, tilt_deg=tilt_deg, relief=relief)
    stripes *= rng.uniform(0.7, 1.2, len(truth)).astype(np.float32)[:, None, None]  # exposure must not matter
    tensors = stripe_tensors(stripes, np.ones((HEIGHT, WIDTH), np.float32)).of_even_strength()
    found = slide_angle_from_tensors(
        tensors, first_stop=tensors[:4].mean(0), second_stop=tensors[-4:].mean(0), sense=-1 if mirrored else 1
    )
    assert np.abs(found - truth).max() < 0.5
    assert np.abs(found[:4]).max() < 0.05
    assert np.abs(found[-4:] - 90).max() < 0.05


def test_jolted_frames_leave_the_others_alone() -> None:
    truth = np.concatenate([np.zeros(4), np.linspace(0, 90, 60), np.full(4, 90.0)])
    tensors = stripe_tensors(stripes_at(truth), np.ones((HEIGHT, WIDTH), np.float32)).of_even_strength()
    jolted = slice(30, 38)
    tensors[jolted] += np.random.default_rng(1).normal(0, 0.2, (8, 3)) * np.abs(tensors[jolted])
    found = slide_angle_from_tensors(tensors, first_stop=tensors[:4].mean(0), second_stop=tensors[-4:].mean(0), sense=1)
    others = np.r_[0:30, 38:68]
    assert np.abs(found - truth)[others].max() < 0.8
    assert np.abs(found - truth)[jolted].max() > 0.8, "the disturbance has to be one"


def test_direction_follows_the_gradient_whatever_the_pitch() -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    for pitch in (4.0, 7.0, 15.0):
        for angle in (-60.0, -20.0, 0.0, 33.0, 70.0):
            phase = 2 * np.pi / pitch * (x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle)))
            tensor = stripe_tensors(np.cos(phase)[None].astype(np.float32), np.ones((HEIGHT, WIDTH), np.float32)).tensor
            assert gradient_direction_deg(tensor)[0] == pytest.approx(angle, abs=0.6)


def test_noise_is_taken_out() -> None:
    rng = np.random.default_rng(5)
    weight = np.ones((HEIGHT, WIDTH), np.float32)
    clean = stripes_at(np.array([20.0]))
    noise = rng.normal(0, 0.5, (60, HEIGHT, WIDTH)).astype(np.float32)
    noisy = stripe_tensors(clean + noise[:30], weight)
    told = noisy.less(stripe_tensors(noise[30:], weight))
    expected = stripe_tensors(clean, weight)
    strongest = expected.tensor.max()
    np.testing.assert_allclose(told.tensor.mean(0), expected.tensor[0], atol=0.02 * strongest)
    np.testing.assert_allclose(told.power.mean(), expected.power[0], rtol=0.02)
    assert noisy.tensor[:, 2].mean() - expected.tensor[0, 2] > 0.5 * strongest, "the noise has to matter"
