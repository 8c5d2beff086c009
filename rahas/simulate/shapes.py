"""Grinding stones, and the plain bodies that measure a method: plane, sphere, steps."""

from __future__ import annotations

import numpy as np

from rahas.simulate.specs import SceneSpec
from rahas.simulate.surface import (
    ALBEDO_SPACING_MM,
    HEIGHT_SPACING_MM,
    Patch,
    Surface,
    fractal_noise,
    grid,
    rock_albedo,
    smooth_noise,
)
from rahas.typing import BoolArray, FloatArray

TARP_ALBEDO = 0.006
LEGS = ((-0.3, 0.15), (-0.3, -0.15), (0.33, 0.0))


def _turned(scene: SceneSpec, patch: Patch, spacing: float) -> tuple[FloatArray, FloatArray]:
    x, y = grid(patch, spacing)
    turn = np.deg2rad(scene.turn_deg)
    return np.cos(turn) * x + np.sin(turn) * y, -np.sin(turn) * x + np.cos(turn) * y


def _stone_outline(scene: SceneSpec, patch: Patch, spacing: float) -> FloatArray:
    """0 in the middle, 1 at the rim (y, x): a rounded slab, 1 long and 0.62 wide, a little ragged."""
    x, y = _turned(scene, patch, spacing)
    ragged = 1 + 0.012 * smooth_noise(patch, spacing, grain_mm=max(scene.size_mm / 9, 3), seed=scene.seed)
    return np.asarray(((np.abs(x / 0.5) ** 2.6 + np.abs(y / 0.31) ** 2.6) ** (1 / 2.6)) / scene.size_mm * ragged)


def metate(scene: SceneSpec, patch: Patch) -> Surface:
    """Underside of a three-legged grinding stone on a black tarp; it spans ``size_mm``."""
    spacing, size = HEIGHT_SPACING_MM, scene.size_mm
    x, y = _turned(scene, patch, spacing)
    rim = _stone_outline(scene, patch, spacing)
    body = 0.16 * size * np.sqrt(np.clip(1 - rim**4, 0, 1))
    for leg_x, leg_y in LEGS:
        away = np.hypot(x / size - leg_x, y / size - leg_y)
        body = body + 0.10 * size * (rim < 1) * 0.5 * (1 + np.cos(np.pi * np.clip(away / 0.13, 0, 1)))
    grain = fractal_noise(patch, spacing, coarsest_mm=12, finest_mm=1.4, roughness=0.9, seed=scene.seed + 3)
    lean = np.tan(np.deg2rad(scene.lean_deg))
    height = np.where(rim < 1, body + 0.3 * scene.relief * grain - lean * grid(patch, spacing)[1], 0)
    height = np.where(rim < 1, np.maximum(height, 0), 0.15 * grain - 2)

    stone = rock_albedo(patch, mean=0.42, contrast=scene.texture, seed=scene.seed)
    tarp = rock_albedo(patch, mean=TARP_ALBEDO, contrast=0.5, seed=scene.seed + 9)
    inside: BoolArray = _stone_outline(scene, patch, ALBEDO_SPACING_MM) < 1
    return Surface(height.astype(np.float32), np.where(inside, stone, tarp), (1.04, 1.0, 0.94))


def plain_body(scene: SceneSpec, patch: Patch) -> Surface:
    """Plane, sphere (of diameter ``size_mm``, on a plane) or steps of 2, 5 and 10 mm; matt and light."""
    x, y = _turned(scene, patch, HEIGHT_SPACING_MM)
    height = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    if scene.kind == "sphere":
        radius = scene.size_mm / 2
        height = np.maximum(np.sqrt(np.clip(radius**2 - x**2 - y**2, 0, None)) - 0.5 * radius, 0)
    if scene.kind == "steps":
        for edge, rise in ((-0.25, 2.0), (0.0, 5.0), (0.25, 10.0)):
            height = height + rise * (x > edge * scene.size_mm)
    height = height - np.tan(np.deg2rad(scene.lean_deg)) * grid(patch, HEIGHT_SPACING_MM)[1]
    speckle = smooth_noise(patch, ALBEDO_SPACING_MM, grain_mm=1.2, seed=scene.seed)
    albedo = 0.7 * (1 + 0.06 * scene.texture * speckle)
    return Surface(height.astype(np.float32), albedo.astype(np.float32), (1.0, 1.0, 1.0))
