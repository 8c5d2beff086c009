"""From light to codes: noise, auto exposure, gamma, luma range."""

from __future__ import annotations

import math

import numba
import numpy as np

from rahas.simulate.specs import CameraSpec
from rahas.typing import ByteArray, Float32Array

LEVELS = 1 << 14
FULL_SCALE = 1.25
"""Light that the code table reaches to; above 1 a sensor clips, but limited range has room for super-white."""


def code_table(camera: CameraSpec) -> ByteArray:
    """Code of each light level, 0 to ``FULL_SCALE`` (LEVELS,)."""
    light = (np.arange(LEVELS) + 0.5) * (FULL_SCALE / LEVELS)
    toe = 0.004
    shaped = ((light + toe) ** (1 / camera.gamma) - toe ** (1 / camera.gamma)) / (
        (1 + toe) ** (1 / camera.gamma) - toe ** (1 / camera.gamma)
    )
    value = camera.pedestal + (1 - camera.pedestal) * shaped
    code = 16 + 219 * value if camera.luma_range == "limited" else 255 * value
    return np.clip(np.rint(code), 1 if camera.luma_range == "limited" else 0, 254.99).astype(np.uint8)


@numba.njit(cache=True, fastmath=True)
def _exposed(
    out: ByteArray,
    light: Float32Array,
    stray: Float32Array,
    noise: Float32Array,
    table: ByteArray,
    stray_level: float,
    gain: float,
    shot: float,
    read: float,
) -> None:
    scale, top = np.float32(len(table) / FULL_SCALE), len(table) - 1
    level, g = np.float32(stray_level), np.float32(gain)
    shot_32, read_32 = np.float32(shot), np.float32(read * read)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x = g * (light[i, j] + level * stray[i, j])
            x += noise[i, j] * math.sqrt(shot_32 * g * x + read_32 * g * g)
            out[i, j] = table[min(max(int(x * scale), 0), top)]


def exposed_frame(
    light: Float32Array,
    stray: Float32Array,
    *,
    camera: CameraSpec,
    table: ByteArray,
    gain: float,
    stray_level: float,
    seed: tuple[int, int],
) -> ByteArray:
    """Codes (y, x) of a moment's lamp light and stray light; the noise follows from the seed alone."""
    noise = np.random.Generator(np.random.SFC64(list(seed))).standard_normal(light.shape, dtype=np.float32)
    out = np.empty(light.shape, np.uint8)
    _exposed(out, light, stray, noise, table, stray_level, gain, camera.shot_noise, camera.read_noise)
    return out


class AutoExposure:
    """A slow regulator: follows the mean light over about half a second, by the share it is told to."""

    def __init__(self, camera: CameraSpec, usual_light: float) -> None:
        self._strength, self._usual = camera.auto_exposure, max(usual_light, 1e-6)
        self._follow = 1 - math.exp(-1 / (0.5 * camera.frame_rate))
        self._gain: float | None = None

    def gain_for(self, mean_light: float) -> float:
        """Gain for the next frame, given the mean light before any gain."""
        wanted = min(max(self._usual / max(mean_light, 1e-6), 0.25), 2.0) ** self._strength
        self._gain = wanted if self._gain is None else self._gain + self._follow * (wanted - self._gain)
        return self._gain
