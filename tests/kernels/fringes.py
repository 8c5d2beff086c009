"""Analytic fringe frames for tests of the phase kernels: a tilting crank over a field, with truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

STRIPES = 20
GRAIN = 0.25  # contrast of the object's fine texture
HALF_FIELD = 0.3  # tangent of half the projector's field


class Fringes(NamedTuple):
    frames: np.ndarray  # (frame, y, x) uint8
    phase: np.ndarray  # (y, x) unwrapped, radians
    delta: np.ndarray  # (frame, y, x) radians
    held: int
    noise: float
    amplitude: np.ndarray  # (y, x), of the light
    response: np.ndarray  # (frame, y, x), grey levels that the camera makes of one grey level more of light
    waveform_slope: np.ndarray  # (frame, y, x), w′ of the light

    def bound(self) -> np.ndarray:
        """(y, x), radians: the Cramér–Rao bound of φ with a and b unknown too."""
        t = self.phase + self.delta
        columns = np.stack([np.ones_like(t), np.cos(t), self.amplitude * self.waveform_slope], axis=-1)
        columns = columns * self.response[..., None]
        information = np.einsum("nyxi,nyxj->yxij", columns, columns) / self.noise**2
        return np.sqrt(np.linalg.inv(information)[..., 2, 2])


def tilted(v: np.ndarray, tilt: float) -> np.ndarray:
    """Slide coordinate that lights a direction once the projector is tilted."""
    return np.tan(np.arctan(HALF_FIELD * v) - tilt) / HALF_FIELD


def uneven_crank(count: int, periods: float, held: int, *, slip: float = 0.0) -> np.ndarray:
    """Tilts of a hand-turned crank: slow start and end, a wobble, a stall; it may slip back by ``slip`` periods."""
    t = np.linspace(0.0, 1.0, count - held)
    path = t * t * (3 - 2 * t) + 0.02 * np.sin(9 * t) * np.sin(np.pi * t)
    path[len(path) // 2 : len(path) // 2 + 3] = path[len(path) // 2]
    path[2 * len(path) // 3 :] -= slip / periods
    path[2 * len(path) // 3 :] *= 1.0 / path[-1]
    end = np.arctan(HALF_FIELD * 2.0 * periods / STRIPES)
    return end * np.concatenate([np.zeros(held), path])


def render(
    *,
    shape: tuple[int, int] = (72, 96),
    count: int = 90,
    periods: float = 1.6,
    noise: float = 1.5,
    second_harmonic: float = 0.0,
    flicker: float = 0.0,
    drift: float = 0.0,
    gamma: float = 1.0,
    slip: float = 0.0,
    brightness: float = 1.0,
    floor: float = 1.4,
    bow: float = 0.0,
    shift_px: float = 0.0,
    seed: int = 0,
) -> Fringes:
    """Frames of a bumpy surface with uneven albedo; the phase grows downwards over about 9 periods.

    ``flicker``: standard deviation of the lamp's brightness; ``drift``: grey levels of ambient light gained over the
    scan; ``gamma``: the camera writes 255·(light/255)^(1/gamma); ``floor``: mean of the light over its swing, near 1
    where the stripes' dark is black; ``bow``: relative change of the step at the field's sides; ``shift_px``: amplitude
    of the object's swaying.
    """
    rng = np.random.default_rng(seed)
    height, width = shape
    held = 6
    tilts = uneven_crank(count, periods, held, slip=slip)
    lamp = 1.0 + flicker * rng.standard_normal(count)
    ambient = drift * np.linspace(-0.5, 0.5, count)
    y, x = np.mgrid[0:height, 0:width].astype(float)
    plane = 0.9 * (2 * y / (shape[0] - 1) - 1)
    relief, amplitude = _object(x, y)
    v = plane + relief
    phase, amplitude = np.pi * STRIPES * v, brightness * amplitude
    delta, frames, response, waveform_slope = (np.empty((count, height, width)) for _ in range(4))
    for n, tilt in enumerate(tilts):
        share = 1.0 + bow * (2 * x / (width - 1) - 1) ** 2
        delta[n] = np.pi * STRIPES * (tilted(v, tilt) - v) * share
        swing = shift_px * np.sin(0.5 * n) * np.exp(-n / 50.0)
        relief, light = _object(x - swing, y - 0.5 * swing)
        here = plane + relief
        t = np.pi * STRIPES * (here + (tilted(here, tilt) - here) * share)
        level = brightness * light * (floor + np.cos(t) + second_harmonic * np.cos(2 * t)) + 8
        level = lamp[n] * level + ambient[n]
        clipped = np.clip(level, 0.5, None)
        frames[n] = 255.0 * (clipped / 255.0) ** (1.0 / gamma)
        response[n] = frames[n] / clipped / gamma
        waveform_slope[n] = -np.sin(t) - 2 * second_harmonic * np.sin(2 * t)
    shot = np.clip(np.rint(frames + rng.normal(0, noise, frames.shape)), 0, 255).astype(np.uint8)
    return Fringes(
        shot,
        phase,
        delta,
        held,
        float(np.hypot(noise, 0.29)),
        amplitude,
        response * lamp[:, None, None],
        waveform_slope,
    )


def _object(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the relief adds to the slide coordinate, and the light it sends back, at (x, y) px."""
    relief = 0.03 * np.sin(x / 17.0) + 0.02 * np.cos(x / 9.0 + y / 13.0)
    grain = 1.0 + GRAIN * np.sin(x / 2.5) * np.cos(y / 3.0)
    return relief, 45.0 * grain * (0.7 + 0.3 * np.sin(x / 23.0) * np.cos(y / 31.0))
