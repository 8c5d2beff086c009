"""A shaded picture of a measured surface: light from the upper left, as rock art is drawn and photographed."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from rahas.kernels.surface import normals_of_grid
from rahas.report.colours import on_hatch

_LIGHT = np.array([-0.55, 0.55, 0.63]) / np.linalg.norm([-0.55, 0.55, 0.63])
_EXAGGERATION = 1.5
_TOWARDS_THE_CAMERA = np.array([0.0, 0.0, 1e4])  # mm


def shading_of(normals: np.ndarray) -> np.ndarray:
    """Brightness 0–1 (y, x) under one light, relief exaggerated about the surface's mean plane; NaN stays NaN."""
    known = normals[np.isfinite(normals).all(axis=2)]
    if known.size == 0:
        return np.full(normals.shape[:2], np.nan)
    mean = np.median(known, axis=0)
    mean /= np.linalg.norm(mean)
    right = np.array([1.0, 0.0, 0.0]) - mean[0] * mean
    right /= np.linalg.norm(right)
    local = normals @ np.column_stack([right, np.cross(mean, right), mean]).astype(np.float32)
    local[..., :2] *= _EXAGGERATION
    local /= np.linalg.norm(local, axis=2, keepdims=True)
    lit = local @ _LIGHT.astype(np.float32)
    return np.clip(0.2 + 0.85 * lit, 0.0, 1.0)


def relief_picture(xyz: Any) -> np.ndarray:
    """The surface as if cast in plaster, (y, x, 3) uint8; hatched where nothing was measured."""
    shading = shading_of(normals_of_grid(np.asarray(xyz, dtype=np.float64), _TOWARDS_THE_CAMERA, radius=1))
    measured = np.isfinite(shading)
    tone = np.where(measured, shading, 0.0)[..., None] * np.array([218.0, 232.0, 240.0])
    return on_hatch(tone.round().astype(np.uint8), measured)


def shaded_colours(picture: np.ndarray, xyz: Any) -> np.ndarray:
    """The relief in plaster, tinted by a coloured map of the same surface (y, x, 3); hatched where not measured."""
    plaster = relief_picture(xyz)
    measured = np.isfinite(np.asarray(xyz)).all(axis=2)
    tinted = cv2.addWeighted(plaster, 0.62, cv2.multiply(plaster, picture, scale=1 / 200), 0.38, 8)
    return on_hatch(tinted, measured)
