"""The roof target: two planes that meet in a vertical ridge, and what a camera sees of them (thesis Figure 2.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import Camera
from rahas.kernels.triangulation import rays_of_camera
from rahas.typing import BoolArray, FloatArray, IntArray


class Roof(NamedTuple):
    """Two planes n·X = d, normals towards the camera."""

    normal: FloatArray
    """(2, 3) unit normals, the left slope first."""
    offset: FloatArray
    """(2,) mm."""
    slope: IntArray
    """(n,) slope of each mark: 0 left, 1 right."""
    rms_mm: float
    """Scatter of the marks about their planes."""


def fit_roof(marks: FloatArray) -> Roof:
    """The two planes through ``marks`` (n, 3): the flattest split from left to right, three or more a side."""
    order = np.argsort(marks[:, 0], kind="stable")
    best: Roof | None = None
    best_score = np.inf
    for count in range(3, len(marks) - 2):
        sides = order[:count], order[count:]
        planes = [_plane(marks[side]) for side in sides]
        normal = np.array([plane[0] for plane in planes])
        offset = np.array([plane[1] for plane in planes])
        slope = np.zeros(len(marks), dtype=np.int64)
        slope[sides[1]] = 1
        distance = np.sum(normal[slope] * marks, axis=1) - offset[slope]
        # three points always lie flat: count only what lies beyond them
        rms = float(np.sqrt(np.sum(distance**2) / max(len(marks) - 6, 1)))
        score = rms + 1e-6 * abs(2 * count - len(marks))  # the evener split where both lie flat
        if score < best_score:
            best, best_score = Roof(normal, offset, slope, rms), score
    if best is None:
        raise ValueError(f"{len(marks)} marks, a roof needs 6")
    return best


def points_on_roof(camera: Camera, roof: Roof, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """World points (n, 3) that ``pixels`` (n, 2) see on the roof, and how far (n,) mm each lies from the ridge line.

    The ridge points to the camera, so a ray enters the roof where it crosses the later of the two planes. The second
    result is the distance to the other plane: small near the ridge, where the neighbouring slope may be seen instead.
    """
    origin, direction = rays_of_camera(camera, pixels)
    reach = (roof.offset - roof.normal @ origin) / (direction @ roof.normal.T)
    later = np.argmax(reach, axis=1)
    points = origin + direction * np.take_along_axis(reach, later[:, None], axis=1)
    other = 1 - later
    distance = np.abs(np.sum(roof.normal[other] * points, axis=1) - roof.offset[other])
    sine = float(np.linalg.norm(np.cross(roof.normal[0], roof.normal[1])))
    return points, distance / max(sine, 1e-9)


def near_marks(points: FloatArray, marks: FloatArray, *, radius_mm: float) -> BoolArray:
    """Which of ``points`` (n, 3) lie within ``radius_mm`` of a mark's centre."""
    near = np.zeros(len(points), dtype=np.bool_)
    for mark in marks:
        near |= np.sum((points - mark) ** 2, axis=1) < radius_mm**2
    return near


def within_marks(points: FloatArray, marks: FloatArray, *, margin_mm: float) -> BoolArray:
    """Which of ``points`` (n, 3) lie in the rectangle of the marks, seen along z, widened by ``margin_mm``."""
    low, high = marks[:, :2].min(axis=0) - margin_mm, marks[:, :2].max(axis=0) + margin_mm
    inside: BoolArray = np.all((points[:, :2] >= low) & (points[:, :2] <= high), axis=1)
    return inside


def centre_shift(camera: Camera, marks: FloatArray, normals: FloatArray, radius_mm: FloatArray) -> FloatArray:
    """Centre of a round mark's image minus the image of its centre, (n, 2) px: perspective makes them differ.

    ``normals`` (n, 3) of the plane of each mark, ``radius_mm`` (n,).
    """
    shift = np.empty((len(marks), 2))
    for index, (mark, normal, radius) in enumerate(zip(marks, normals, radius_mm, strict=True)):
        first, second = _plane_axes(normal)
        frame = camera.matrix @ np.vstack([np.column_stack([first, second, mark]), [0.0, 0.0, 1.0]])
        dual = frame @ np.diag([radius**2, radius**2, -1.0]) @ frame.T
        shift[index] = dual[:2, 2] / dual[2, 2] - frame[:2, 2] / frame[2, 2]
    return shift


def mark_radius(camera: Camera, marks: FloatArray, normals: FloatArray, semi_axes: FloatArray) -> FloatArray:
    """Radius (n,) mm of round marks from the area of their images, ``semi_axes`` (n, 2) px."""
    radius = np.empty(len(marks))
    for index, (mark, normal) in enumerate(zip(marks, normals, strict=True)):
        first, second = _plane_axes(normal)
        frame = camera.matrix @ np.vstack([np.column_stack([first, second, mark]), [0.0, 0.0, 1.0]])
        point, depth = frame[:2, 2] / frame[2, 2], frame[2, 2]
        jacobian = (frame[:2, :2] - np.outer(point, frame[2, :2])) / depth
        radius[index] = np.sqrt(semi_axes[index, 0] * semi_axes[index, 1] / abs(np.linalg.det(jacobian)))
    return radius


def _plane(points: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (z > 0) and offset of the plane through points."""
    mean = points.mean(axis=0)
    normal = np.linalg.svd(points - mean)[2][2]
    normal = normal if normal[2] > 0 else -normal
    return normal, float(normal @ mean)


def _plane_axes(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that span the plane of ``normal``."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)
