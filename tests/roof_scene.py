"""A rig and a roof target with exact phase, drawn from their equations: truth for calibration and cloud tests."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.camera import Camera, project
from rahas.kernels.projector import phase_of_projector
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera
from rahas.typing import FloatArray

WIDTH, HEIGHT = 360, 240
RADIUS_MM = 9.0


def roof_target() -> FloatArray:
    """(18, 3) mm, numbered down the columns from the left slope's ridge side outwards, then the right slope."""
    rows = [
        (start + side * 35.0 * column, -60.0 * row, -14.1409 * column)
        for side, start in ((-1.0, 0.0), (1.0, 60.0))
        for column in range(3)
        for row in range(3)
    ]
    return np.array(rows)


def camera_at(
    *,
    turn_deg: float = 0.0,
    yaw_deg: float = 5.0,
    pitch_deg: float = -4.0,
    focal: float = 1.35,
    radial: float = 0.0,
    width: int = WIDTH,
    height: int = HEIGHT,
    shift_mm: tuple[float, float] = (0.0, 0.0),
) -> Camera:
    """A camera 620 mm before the target, which it sees in the middle of its image; focal length in image widths."""
    roll, yaw, pitch = np.deg2rad([turn_deg, yaw_deg, pitch_deg])
    about_z = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    facing = np.diag([1.0, -1.0, -1.0])  # image x right, y down, depth away
    rotation = about_z @ about_x @ about_y @ facing
    middle = np.array([30.0 + shift_mm[0], -60.0 + shift_mm[1], 0.0])
    translation = np.array([0.0, 0.0, 620.0]) - rotation @ middle
    inner = np.array([[focal * width, 0, (width - 1) / 2], [0, focal * width, (height - 1) / 2], [0, 0, 1]])
    matrix = inner @ np.column_stack([rotation, translation])
    return Camera(matrix / matrix[2, 3], radial, np.array([(width - 1) / 2, (height - 1) / 2]))


def projector_above(*, baseline_mm: float = 170.0, stripes: float = 13.0) -> FloatArray:
    """(2, 4) projector above the camera; about ``stripes`` periods over the target's height, growing downwards."""
    tilt = np.arctan2(baseline_mm, 620.0)
    down = np.array([0.0, -np.cos(tilt), np.sin(tilt)])
    depth = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    place = np.array([30.0, -60.0 + baseline_mm, 620.0])
    slope = stripes / 0.42
    top = slope * np.append(down, -down @ place) + 9.3 * np.append(depth, -depth @ place)
    matrix = np.vstack([top, np.append(depth, -depth @ place)])
    return matrix / matrix[1, 3]


class Scene(NamedTuple):
    """What the camera sees of the target."""

    image: FloatArray  # (y, x) grey levels
    unwrapped_phase: FloatArray  # (y, x) rad
    points: FloatArray  # (y, x, 3) mm


def see_roof(
    camera: Camera, projector: FloatArray, *, width: int = WIDTH, height: int = HEIGHT, hidden: tuple[int, ...] = ()
) -> Scene:
    """The roof, filling the image, with dark marks drawn by their equation at four times the resolution."""
    target = roof_target()
    roof = fit_roof(target)
    fine = 4
    grid = (pixel_grid(height * fine, width * fine) + 0.5) / fine - 0.5
    seen, _ = points_on_roof(camera, roof, grid.reshape(-1, 2))
    image = np.full(len(seen), 150.0)
    for index, mark in enumerate(target):
        if index not in hidden:
            image[np.sum((seen - mark) ** 2, axis=1) < RADIUS_MM**2] = 15.0
    image = cv2.resize(image.reshape(height * fine, width * fine), (width, height), interpolation=cv2.INTER_AREA)
    points, _ = points_on_roof(camera, roof, pixel_grid(height, width).reshape(-1, 2))
    points = points.reshape(height, width, 3)
    return Scene(image, phase_of_projector(projector, points), points)


def see_relief(camera: Camera, projector: FloatArray, *, seed: int = 5) -> Scene:
    """A bumpy plane near the target's place, by fixed-point iteration along the rays."""
    rng = np.random.default_rng(seed)
    waves = [(rng.uniform(15, 90), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)) for _ in range(12)]
    origin, direction = rays_of_camera(camera, pixel_grid(HEIGHT, WIDTH))
    height = np.zeros((HEIGHT, WIDTH))
    for _ in range(12):
        points = origin + direction * ((height - origin[2]) / direction[..., 2])[..., None]
        height = 4.0 + sum(
            0.03
            * length
            * np.sin(2 * np.pi * (points[..., 0] * np.cos(way) + points[..., 1] * np.sin(way)) / length + start)
            for length, way, start in waves
        )
    points = origin + direction * ((height - origin[2]) / direction[..., 2])[..., None]
    return Scene(np.full((HEIGHT, WIDTH), 120.0), phase_of_projector(projector, points), points)


def marks_in_image(camera: Camera) -> FloatArray:
    """(18, 2) px of the marks' centres."""
    return project(camera, roof_target())


def projector_place(*, baseline_mm: float = 170.0) -> FloatArray:
    """(3,) mm, centre of projection of :func:`projector_above`."""
    return np.array([30.0, -60.0 + baseline_mm, 620.0])


def first_stop_above(*, baseline_mm: float = 170.0, turns: float = 30.0) -> FloatArray:
    """(2, 4) the same projector with the slide at its first stop: ``turns`` periods a tangent, growing with x."""
    tilt = np.arctan2(baseline_mm, 620.0)
    depth = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    place = projector_place(baseline_mm=baseline_mm)
    across = turns * np.array([1.0, 0.0, 0.0]) + 0.7 * depth
    matrix = np.vstack([np.append(across, -across @ place), np.append(depth, -depth @ place)])
    return matrix / matrix[1, 3]
