"""The calibration target: two white planes meeting in a vertical ridge, 3 × 3 dark marks on each (thesis 2.3)."""

from __future__ import annotations

import numpy as np

from rahas.simulate.rig import target_rotation
from rahas.simulate.specs import PoseSpec, SceneSpec
from rahas.simulate.surface import ALBEDO_SPACING_MM, HEIGHT_SPACING_MM, Patch, Surface, grid, smooth_noise
from rahas.typing import FloatArray

SLOPE_DEG = 22.0
FROM_RIDGE_MM = (30.0, 66.0, 102.0)
ROWS_MM = (56.0, 0.0, -56.0)
DIAMETER_MM = 15.0
BOARD_ALBEDO = 0.85
MARK_ALBEDO = 0.05


def marks_about_middle() -> FloatArray:
    """The 18 marks (18, 3) about the ridge's middle; left slope row by row, then the right, each left to right."""
    slope = np.deg2rad(SLOPE_DEG)
    marks = [
        (side * along * np.cos(slope), row, -along * np.sin(slope))
        for side in (-1, 1)
        for row in ROWS_MM
        for along in (FROM_RIDGE_MM[::-1] if side < 0 else FROM_RIDGE_MM)
    ]
    return np.array(marks)


def target_marks() -> FloatArray:
    """The 18 marks (18, 3) in mm relative to mark 1, as config/target.csv has them."""
    marks = marks_about_middle()
    return marks - marks[0]


def target_origin(pose: PoseSpec) -> FloatArray:
    """Mark 1 in the scene's frame (3,)."""
    middle = np.array([pose.x_mm, pose.y_mm, pose.z_mm])
    return np.asarray(middle + target_rotation(pose) @ marks_about_middle()[0])


def roof(scene: SceneSpec, pose: PoseSpec, patch: Patch) -> Surface:
    """The target in its pose; the board reaches beyond the picture."""
    rotation, middle = target_rotation(pose), np.array([pose.x_mm, pose.y_mm, pose.z_mm])
    height = _roof_height(rotation, middle, *grid(patch, HEIGHT_SPACING_MM))

    x, y = grid(patch, ALBEDO_SPACING_MM)
    z = _roof_height(rotation, middle, x, y)
    local = np.stack([x - middle[0] + 0 * y, y - middle[1] + 0 * x, z - middle[2]], axis=-1) @ rotation
    along = np.hypot(local[..., 0], local[..., 2])
    albedo = BOARD_ALBEDO * (
        1 + 0.012 * scene.texture * smooth_noise(patch, ALBEDO_SPACING_MM, grain_mm=1, seed=scene.seed)
    )
    for column in FROM_RIDGE_MM:
        for row in ROWS_MM:
            distance = np.hypot(along - column, local[..., 1] - row)
            outside = np.clip((distance - DIAMETER_MM / 2) / ALBEDO_SPACING_MM + 0.5, 0, 1)
            albedo = MARK_ALBEDO + (albedo - MARK_ALBEDO) * outside
    return Surface(height.astype(np.float32), albedo.astype(np.float32), (1.0, 1.0, 0.98))


def _roof_height(rotation: FloatArray, middle: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    heights = []
    for side in (-1.0, 1.0):
        normal = rotation @ np.array([side * np.sin(np.deg2rad(SLOPE_DEG)), 0.0, np.cos(np.deg2rad(SLOPE_DEG))])
        heights.append(middle[2] - (normal[0] * (x - middle[0]) + normal[1] * (y - middle[1])) / normal[2])
    return np.minimum(*heights)
