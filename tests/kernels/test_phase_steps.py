"""Phase steps of uneven hands, against truth and the noise bound."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.phase_steps import advanced_iterative_steps, path_share, pattern_from_steps, with_zero_at

FRAMES, PIXELS, NOISE = 120, 800, 2.0


def hand(kind: str) -> np.ndarray:
    """Steps (frame) in radians: a hold, a motion that starts and ends slowly, a hold."""
    way = np.clip((np.arange(FRAMES) - 15) / 85.0, 0, 1)
    smooth = way - np.sin(2 * np.pi * way) / (2 * np.pi)
    periods = {"even": 1.6, "short": 0.8, "long": 4.3, "upwards": -1.3, "stall": 1.6, "slip": 1.6}[kind]
    if kind in ("stall", "slip"):
        back = 0.0 if kind == "stall" else -0.012
        pace = np.gradient(smooth)
        pace[50:62] = back
        smooth = np.cumsum(pace) / pace.sum()
        smooth -= smooth[0]
    return 2 * np.pi * periods * smooth


def samples_of(step: np.ndarray, *, seed: int = 0, flicker: float = 0.0, drift: float = 0.0):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(-np.pi, np.pi, PIXELS)
    background, modulation = rng.uniform(40, 120, PIXELS), rng.uniform(15, 40, PIXELS)
    gain = 1 + flicker * np.sin(np.arange(len(step)) * 0.9)
    offset = drift * np.linspace(0, 1, len(step))
    light = background + modulation * np.cos(phase + step[:, None])
    frames = gain[:, None] * light + offset[:, None] + rng.normal(0, NOISE, (len(step), PIXELS))
    return frames.astype(np.float32), phase, background, modulation


@pytest.mark.parametrize("kind", ["even", "short", "long", "upwards", "stall", "slip"])
def test_steps_of_every_hand(kind: str) -> None:
    truth = hand(kind)
    samples, _, _, modulation = samples_of(truth)
    rough = truth + 0.15 * np.sin(2 * truth) + 0.05
    found = with_zero_at(advanced_iterative_steps(samples, np.ones(PIXELS, np.float32), start=rough).step, slice(0, 15))
    error = found - truth
    bound = np.sqrt(2 / PIXELS) * NOISE / np.sqrt((modulation**2).mean())
    assert np.std(error) < 2.5 * bound
    assert np.std(error) > 0.4 * bound, "no estimate beats the noise"
    assert np.abs(error).max() < 0.03


@pytest.mark.parametrize(("flicker", "drift"), [(0.05, 0.0), (0.0, 15.0), (0.05, 15.0)])
def test_lamp_and_daylight_do_not_matter(flicker: float, drift: float) -> None:
    truth = hand("even")
    samples, *_ = samples_of(truth, flicker=flicker, drift=drift)
    steps = advanced_iterative_steps(samples, np.ones(PIXELS, np.float32), start=truth + 0.1 * np.cos(truth)).step
    assert np.std(with_zero_at(steps, slice(0, 15)) - truth) < 0.012


def test_weights_give_the_step_at_a_point() -> None:
    """Half of the pixels see a step 4 % larger, half one 4 % smaller: weights choose."""
    truth = hand("even")
    phase = np.random.default_rng(2).uniform(-np.pi, np.pi, PIXELS)
    more = np.where(np.arange(PIXELS) < PIXELS // 2, 1.04, 0.96)
    samples = (80 + 30 * np.cos(phase + truth[:, None] * more)).astype(np.float32)
    for chosen, factor in (((more > 1).astype(np.float32), 1.04), (np.ones(PIXELS, np.float32), 1.0)):
        steps = advanced_iterative_steps(samples, chosen, start=truth).step
        total = with_zero_at(steps, slice(0, 15))[-1]
        assert total == pytest.approx(truth[-1] * factor, abs=0.06)


def test_start_settles_the_sign() -> None:
    truth = hand("even")
    samples, *_ = samples_of(truth)
    weight = np.ones(PIXELS, np.float32)
    up = advanced_iterative_steps(samples, weight, start=truth)
    down = advanced_iterative_steps(samples, weight, start=-truth)
    np.testing.assert_allclose(up.step, -down.step, atol=0.01)
    np.testing.assert_allclose(np.exp(1j * up.wrapped_phase), np.exp(-1j * down.wrapped_phase), atol=0.05)


def test_pattern_follows_from_the_steps_whatever_the_blocks() -> None:
    truth = hand("even")
    samples, phase, background, modulation = samples_of(np.concatenate([truth, np.full(40, truth[-1])]))
    stack = np.round(samples * 64).astype(np.uint16).reshape(-1, 20, 40)
    fit = pattern_from_steps(stack, np.concatenate([truth, np.full(40, truth[-1])]), first=0, scale=1 / 64)
    assert np.std(fit.background.ravel() - background) < 0.6
    assert np.std(fit.modulation.ravel() - modulation) < 0.8
    wrapped = np.angle(np.exp(1j * (fit.wrapped_phase.ravel() - phase)))
    assert np.std(wrapped) < 0.035
    later = pattern_from_steps(stack, truth[10:], first=10, scale=1 / 64)
    assert np.std(later.modulation - fit.modulation) < 0.5


def test_a_hold_does_not_outweigh_the_scan() -> None:
    truth = np.concatenate([np.zeros(2000), hand("even")])
    share = path_share(truth)
    assert share[:1990].sum() < share[2000:].sum()
    assert share.min() > 0
