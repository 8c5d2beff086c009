"""Carvings pecked into rough rock: circle, monkey and tri-circle."""

from __future__ import annotations

import cv2
import numpy as np

from rahas.simulate.specs import SceneSpec
from rahas.simulate.surface import (
    HEIGHT_SPACING_MM,
    Patch,
    Surface,
    fractal_noise,
    grid,
    on_albedo_grid,
    rock_albedo,
    smooth_noise,
)
from rahas.typing import Float32Array, FloatArray

Strokes = list[FloatArray]

GROOVE_MM = 3.2
GROOVE_HALF_WIDTH_MM = 5.5


def _ring(x: float, y: float, radius: float, start_deg: float = 0, end_deg: float = 360) -> FloatArray:
    angle = np.deg2rad(np.linspace(start_deg, end_deg, 80))
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=-1)


def _line(*points: tuple[float, float]) -> FloatArray:
    return np.array(points, dtype=float)


def _tail() -> FloatArray:
    angle = np.deg2rad(np.linspace(-90, 470, 120))
    radius = np.linspace(0.19, 0.035, 120)
    return np.stack([0.36 + radius * np.cos(angle), -0.14 + radius * np.sin(angle)], axis=-1)


def strokes_of(kind: str) -> Strokes:
    """Centre lines of the carving; its height is about 1, x right and y up."""
    if kind == "circle":
        return [_ring(0, 0, radius) for radius in (0.48, 0.34, 0.2)] + [_ring(0, 0, 0.03)]
    if kind == "tricircle":
        centres = ((0.0, 0.26), (-0.42, -0.24), (0.42, -0.24))
        rings = [_ring(x, y, radius) for x, y in centres for radius in (0.22, 0.1)]
        return [*rings, _line((-0.12, 0.07), (-0.29, -0.06)), _line((0.12, 0.07), (0.29, -0.06))]
    face = [_ring(-0.05, 0.27, 0.2), _ring(-0.28, 0.36, 0.06), _ring(0.18, 0.36, 0.06)]
    pits = [_ring(-0.12, 0.31, 0.012), _ring(0.02, 0.31, 0.012), _ring(-0.05, 0.2, 0.012)]
    body = [_line((-0.05, 0.07), (-0.05, -0.3)), _line((-0.4, -0.12), (-0.32, 0.02), (-0.05, -0.02), (0.14, 0.04))]
    legs = [
        _line((-0.24, -0.48), (-0.2, -0.33), (-0.05, -0.3), (0.12, -0.36), (0.14, -0.48)),
        _line((-0.05, -0.28), (0.36, -0.33)),
    ]
    return [*face, *pits, *body, *legs, _tail()]


def distance_to_strokes(strokes: Strokes, *, spacing: float, patch: Patch) -> Float32Array:
    """Distance in mm to the nearest centre line (y, x); strokes in mm."""
    x, y = grid(patch, spacing)
    canvas = np.full((y.size, x.size), 255, np.uint8)
    for stroke in strokes:
        points = np.stack([stroke[:, 0] + patch.half_width, stroke[:, 1] + patch.half_height], axis=-1) / spacing
        cv2.polylines(canvas, [np.round(points * 16).astype(np.int32)], False, 0, 1, cv2.LINE_8, 4)
    return np.asarray(cv2.distanceTransform(canvas, cv2.DIST_L2, cv2.DIST_MASK_5), np.float32) * np.float32(spacing)


def petroglyph(scene: SceneSpec, patch: Patch) -> Surface:
    """Rough rock that fills the patch, with the carving in the middle."""
    spacing, seed = HEIGHT_SPACING_MM, scene.seed
    _, y = grid(patch, spacing)
    swell = 6.0 * smooth_noise(patch, spacing, grain_mm=110, seed=seed)
    bumps = 0.8 * fractal_noise(patch, spacing, coarsest_mm=24, finest_mm=1.4, roughness=0.95, seed=seed + 7)
    height = scene.relief * (swell + bumps) - np.tan(np.deg2rad(scene.lean_deg)) * y

    turn = np.deg2rad(scene.turn_deg)
    matrix = scene.size_mm * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    distance = distance_to_strokes([s @ matrix for s in strokes_of(scene.kind)], spacing=spacing, patch=patch)
    ragged = 1 + 0.18 * smooth_noise(patch, spacing, grain_mm=5, seed=seed + 17)
    across = np.clip(distance / (GROOVE_HALF_WIDTH_MM * np.clip(ragged, 0.5, 1.6)), 0, 1)
    groove = 0.5 * (1 + np.cos(np.pi * across))
    pecks = smooth_noise(patch, spacing, grain_mm=2.2, seed=seed + 27)
    height = height - groove * (GROOVE_MM + 0.25 * scene.relief * pecks)

    albedo = rock_albedo(patch, mean=0.34, contrast=scene.texture, seed=seed)
    albedo = albedo * (1 - 0.22 * on_albedo_grid(groove.astype(np.float32), patch))
    return Surface(height.astype(np.float32), albedo.astype(np.float32), (1.06, 1.0, 0.9))
