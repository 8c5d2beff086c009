"""A surface as a height field with albedo, and the noise that rocks are made of."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.typing import Float32Array, FloatArray

HEIGHT_SPACING_MM = 0.4
ALBEDO_SPACING_MM = 0.2


class Patch(NamedTuple):
    """The rectangle of the scene that can be seen, mm."""

    half_width: float
    half_height: float


class Surface(NamedTuple):
    """Height field in the scene's frame, rows along +y, columns along +x, centred on the origin."""

    height: Float32Array
    """mm towards the camera (y, x), every ``HEIGHT_SPACING_MM``."""
    albedo: Float32Array
    """0 to 1 (y, x), every ``ALBEDO_SPACING_MM``, over the same patch."""
    tint: tuple[float, float, float]
    """Colour of the surface: red, green, blue about 1."""


def grid(patch: Patch, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates x (1, n) and y (m, 1) of a grid over the patch."""
    columns, rows = round(2 * patch.half_width / spacing) + 1, round(2 * patch.half_height / spacing) + 1
    return ((np.arange(columns) - (columns - 1) / 2) * spacing)[None, :], (
        (np.arange(rows) - (rows - 1) / 2) * spacing
    )[:, None]


def smooth_noise(patch: Patch, spacing: float, *, grain_mm: float, seed: int) -> Float32Array:
    """Noise of unit rms and one grain size over the patch's grid (y, x)."""
    x, y = grid(patch, spacing)
    coarse_columns, coarse_rows = int(2 * patch.half_width / grain_mm) + 5, int(2 * patch.half_height / grain_mm) + 5
    coarse = np.random.default_rng([seed, round(grain_mm * 1000)]).standard_normal((coarse_rows, coarse_columns))
    columns = (x.ravel() + patch.half_width) / grain_mm + 1.5
    rows = (y.ravel() + patch.half_height) / grain_mm + 1.5
    return _spline_rows(_spline_rows(coarse.astype(np.float32), columns).T.copy(), rows).T.copy() * np.float32(1.9)


def _spline_rows(values: Float32Array, positions: FloatArray) -> Float32Array:
    """Uniform cubic B-spline along the last axis at fractional positions."""
    base = np.floor(positions).astype(np.int64)
    t = (positions - base).astype(np.float32)
    weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    total = np.zeros((values.shape[0], len(positions)), np.float32)
    for offset, weight in zip((-1, 0, 1, 2), weights, strict=True):
        total += values[:, np.clip(base + offset, 0, values.shape[1] - 1)] * (weight / 6)
    return total


def fractal_noise(
    patch: Patch, spacing: float, *, coarsest_mm: float, finest_mm: float, roughness: float, seed: int
) -> Float32Array:
    """Octaves of noise from the coarsest grain to the finest; amplitude falls as grain^roughness, coarsest 1."""
    x, y = grid(patch, spacing)
    total = np.zeros((y.size, x.size), np.float32)
    grain = coarsest_mm
    while grain >= finest_mm:
        total += smooth_noise(patch, spacing, grain_mm=grain, seed=seed) * np.float32(
            (grain / coarsest_mm) ** roughness
        )
        grain /= 2
    return total


def rock_albedo(patch: Patch, *, mean: float, contrast: float, seed: int) -> Float32Array:
    """Speckled stone: veins and stains of all sizes down to the pixel of the photo."""
    stains = fractal_noise(patch, ALBEDO_SPACING_MM, coarsest_mm=40, finest_mm=5, roughness=0.4, seed=seed + 101)
    speckle = fractal_noise(patch, ALBEDO_SPACING_MM, coarsest_mm=3, finest_mm=0.5, roughness=0.2, seed=seed + 202)
    albedo = mean * np.exp(contrast * (0.09 * stains + 0.07 * speckle))
    return np.clip(albedo, 0.002, 0.98).astype(np.float32)


def on_albedo_grid(height_map: Float32Array, patch: Patch) -> Float32Array:
    """A map on the height grid brought to the albedo's grid (aligned at the corners)."""
    x, y = grid(patch, ALBEDO_SPACING_MM)
    columns = (x.ravel() + patch.half_width) / HEIGHT_SPACING_MM
    rows = (y.ravel() + patch.half_height) / HEIGHT_SPACING_MM
    map_x, map_y = np.meshgrid(columns.astype(np.float32), rows.astype(np.float32))
    return np.asarray(cv2.remap(height_map, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
