"""World points from camera pixels and unwrapped phase (thesis equations 2.13–2.17), with their uncertainty.

The 3 × 3 system of the thesis says: the point lies on the pixel's ray, and on the plane of light that its phase names.
Solved in that order it has a closed form, the same for every pixel: with the ray c + t·d and the plane
n = M₁ᵖ − y·M₂ᵖ (y = Φ/2π), t = −n·(c, 1) / n·(d, 0).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import Camera, undistort
from rahas.typing import AnyArray, FloatArray

TURN = 2.0 * np.pi


class Triangulation(NamedTuple):
    """World points and how they move with the phase."""

    points: FloatArray
    """(…, 3) mm, NaN where the phase is NaN or the ray misses the plane of light."""
    per_radian: FloatArray
    """(…, 3) ∂X/∂Φ, mm per radian."""


def rays_of_camera(camera: Camera, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centre of projection (3,) mm, and directions (…, 3) of the rays of ``pixels`` (…, 2), away from the camera.

    A direction's length is such that depth along the optical axis grows evenly with it.
    """
    inverse = np.linalg.inv(camera.matrix[:, :3])
    origin: FloatArray = -inverse @ camera.matrix[:, 3]
    plain = undistort(pixels, radial=camera.radial, centre=camera.centre)
    direction: FloatArray = plain @ inverse[:, :2].T + inverse[:, 2]
    # m12 = 1: the world origin has positive depth, so positive t is in front of the camera
    return origin, direction


def triangulate(
    origin: FloatArray, direction: FloatArray, unwrapped_phase: AnyArray, projector: FloatArray
) -> Triangulation:
    """Meet rays (…, 3) from ``origin`` with the planes of light of ``unwrapped_phase`` (…) in radians.

    ``projector`` is the (2, 4) matrix that takes (X, Y, Z, 1) to the two terms of Φ/2π.
    """
    value = np.asarray(unwrapped_phase, dtype=np.float64) / TURN
    top_at_origin, bottom_at_origin = projector[:, :3] @ origin + projector[:, 3]
    top, bottom = direction @ projector[0, :3], direction @ projector[1, :3]
    across = top - value * bottom
    missed = np.abs(across) < 1e-12 * np.abs(bottom_at_origin)
    across = np.where(missed, np.nan, across)
    reach = (value * bottom_at_origin - top_at_origin) / across
    # dt/dy by the quotient rule
    rate = (bottom_at_origin + reach * bottom) / across
    behind = ~(reach > 0)
    reach = np.where(behind, np.nan, reach)
    points = origin + reach[..., None] * direction
    return Triangulation(points, (np.where(behind, np.nan, rate) / TURN)[..., None] * direction)


def pixel_grid(height: int, width: int, *, step: int = 1) -> FloatArray:
    """Pixel coordinates (y, x, 2) of an image, every ``step``-th."""
    y, x = np.mgrid[0:height:step, 0:width:step]
    return np.stack([x, y], axis=-1).astype(np.float64)
