"""Analytic fringe frames for tests of the phase kernels: a tilting crank over a field, with truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

STRIPES = 20
HALF_FIELD = 0.3  # tangent of half the projector's field


class Fringes(NamedTuple):
    frames: np.ndarray  # (frame, y, x) uint8 or float
    phase: np.ndarray  # (y, x) unwrapped, radians
    delta: np.ndarray  # (frame, y, x) radians
    held: int
    noise: float
    amplitude: np.ndarray  # (y, x)


def tilted(v: np.ndarray, tilt: float) -> np.ndarray:
    """Slide coordinate that lights a direction once the projector is tilted."""
    return np.tan(np.arctan(HALF_FIELD * v) - tilt) / HALF_FIELD


def uneven_crank(count: int, periods: float, held: int) -> np.ndarray:
    """Tilts of a hand-turned crank: slow start and end, a wobble, a stall."""
    t = np.linspace(0.0, 1.0, count - held)
    path = t * t * (3 - 2 * t) + 0.02 * np.sin(9 * t) * np.sin(np.pi * t)
    path[len(path) // 2 : len(path) // 2 + 3] = path[len(path) // 2]
    end = np.arctan(HALF_FIELD * 2.0 * periods / STRIPES)
    return end * np.concatenate([np.zeros(held), path])


def render(
    *,
    shape: tuple[int, int] = (96, 128),
    count: int = 90,
    periods: float = 1.6,
    noise: float = 1.5,
    second_harmonic: float = 0.0,
    flicker: float = 0.0,
    seed: int = 0,
) -> Fringes:
    """Frames of a bumpy surface with uneven albedo; the phase grows downwards over about 9 periods."""
    rng = np.random.default_rng(seed)
    height, width = shape
    y, x = np.mgrid[0:height, 0:width]
    v = 0.9 * (2 * y / (height - 1) - 1) + 0.03 * np.sin(x / 17.0) + 0.02 * np.cos(x / 9.0 + y / 13.0)
    amplitude = 45.0 * (0.7 + 0.3 * np.sin(x / 23.0) * np.cos(y / 31.0))
    background = 1.4 * amplitude + 8
    phase = np.pi * STRIPES * v
    held = 6
    tilts = uneven_crank(count, periods, held)
    delta = np.stack([np.pi * STRIPES * (tilted(v, t) - v) for t in tilts])
    t = phase + delta
    frames = background + amplitude * (np.cos(t) + second_harmonic * np.cos(2 * t))
    frames = frames * (1.0 + flicker * rng.standard_normal(count))[:, None, None]
    frames = np.clip(np.rint(frames + rng.normal(0, noise, t.shape)), 0, 255).astype(np.uint8)
    return Fringes(frames, phase, delta, held, float(np.hypot(noise, 0.29)), amplitude)
