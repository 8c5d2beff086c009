"""Unwrapped phase and a calibrated rig → points on the camera's grid, band by band so that memory stays bounded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rahas.kernels.projector_lens import phase_without_lens
from rahas.kernels.triangulation import Triangulation, pixel_grid, rays_of_camera, triangulate
from rahas.stages.rig import Rig
from rahas.typing import AnyArray, Float32Array, FloatArray

_BAND_PIXELS = 1 << 16
"""A pixel's rays and derivatives take some hundred bytes on the way to its point."""


class SurfacePoints(NamedTuple):
    """Points and the part of their uncertainty that the phase's noise makes; NaN where nothing was measured."""

    points: Float32Array
    """(y, x, 3) mm."""
    distance: Float32Array
    """(y, x) mm from the camera."""
    distance_std: Float32Array
    """(y, x) mm, along the ray."""
    z_std: Float32Array
    """(y, x) mm."""


def surface_points(rig: Rig, unwrapped_phase: AnyArray, phase_std: AnyArray) -> SurfacePoints:
    """Triangulate ``unwrapped_phase`` (y, x) with its standard deviation, radians both."""
    shape = unwrapped_phase.shape
    out = SurfacePoints(np.empty((*shape, 3), np.float32), *(np.empty(shape, np.float32) for _ in range(3)))
    for rows in row_bands(*shape):
        origin, found = _band(rig, unwrapped_phase, rows)
        noise = np.nan_to_num(np.asarray(phase_std[rows], dtype=np.float64), nan=0.0)
        out.points[rows] = found.points
        out.distance[rows] = np.linalg.norm(found.points - origin, axis=-1)
        out.distance_std[rows] = noise * np.linalg.norm(found.per_radian, axis=-1)
        out.z_std[rows] = noise * np.abs(found.per_radian[..., 2])
    return out


def points_of(rig: Rig, unwrapped_phase: AnyArray) -> Float32Array:
    """Points (y, x, 3) mm alone."""
    points = np.empty((*unwrapped_phase.shape, 3), np.float32)
    for rows in row_bands(*unwrapped_phase.shape):
        points[rows] = _band(rig, unwrapped_phase, rows)[1].points
    return points


def pixel_angle(rig: Rig) -> float:
    """Angle between neighbouring rays at the image's middle, rad."""
    middle = np.array([rig.camera.width_px // 2, rig.camera.height_px // 2], dtype=np.float64)
    _, (first, second) = rays_of_camera(rig.camera.camera, middle + np.array([[0.0, 0.0], [1.0, 0.0]]))
    return float(np.linalg.norm(np.cross(first, second)) / (np.linalg.norm(first) * np.linalg.norm(second)))


def row_bands(height: int, width: int) -> Iterator[slice]:
    """Bands of rows, together the whole image."""
    size = max(1, _BAND_PIXELS // width)
    return (slice(first, min(first + size, height)) for first in range(0, height, size))


def _band(rig: Rig, unwrapped_phase: AnyArray, rows: slice) -> tuple[FloatArray, Triangulation]:
    """The camera's centre, and the rows' points."""
    phase = np.asarray(unwrapped_phase[rows], dtype=np.float64)
    grid = pixel_grid(*phase.shape) + np.array([0.0, rows.start])
    origin, direction = rays_of_camera(rig.camera.camera, grid)
    plain = phase_without_lens(origin, direction, phase, rig.projector, rig.lens)
    return origin, triangulate(origin, direction, plain, rig.projector)
