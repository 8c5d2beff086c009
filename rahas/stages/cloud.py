"""From unwrapped phase and a calibrated rig to a coloured cloud on the camera's grid (thesis 2.3.2, 4.6)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.banding import ORDERS, Debanded, deband
from rahas.kernels.camera import project
from rahas.kernels.rig_uncertainty import depth_std_from_calibration
from rahas.kernels.surface import normals_of_grid, surface_mask
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from rahas.params import CloudParams
from rahas.stages.rig import ImagingCamera, Rig
from rahas.typing import AnyArray, BoolArray, ByteArray, Float32Array, FloatArray

_UNCERTAINTY_STEP = 16
_FARTHEST = 8.0  # times the distance of the target


class Cloud(NamedTuple):
    """A measured surface on the camera's grid."""

    points: Float32Array
    """(y, x, 3) mm, NaN where nothing was measured."""
    points_before_debanding: Float32Array
    """(y, x, 3) mm."""
    z_std: Float32Array
    """(y, x) mm: phase noise and calibration together."""
    normals: Float32Array
    """(y, x, 3) unit vectors towards the camera."""
    colour: ByteArray
    """(y, x, 3) red, green, blue."""
    debanded: Debanded
    measured_share: float
    """Share of the pixels with phase that are points of the cloud."""
    warnings: list[str]


def make_cloud(
    *,
    unwrapped_phase: AnyArray,
    phase_std: AnyArray,
    background: AnyArray,
    rig: Rig,
    photo: ByteArray | None,
    params: CloudParams,
) -> Cloud:
    """Triangulate, deband, clean and colour.

    All images are (y, x); ``unwrapped_phase`` and ``phase_std`` in radians, NaN where not measured; ``photo`` is
    (y, x, 3) red, green, blue, of any size, from the texture camera.

    Raises
    ------
    CaptureProblem
        (rule ``calibration``) The calibration is another image size's, or no surface comes out of it.
    """
    height, width = unwrapped_phase.shape
    if (rig.camera.width_px, rig.camera.height_px) != (width, height):
        raise CaptureProblem(
            "calibration",
            "image_size",
            f"The scan's images are {width} × {height} pixels, its calibration's {rig.camera.width_px} × "
            f"{rig.camera.height_px}. Use the camera's same setting for both.",
            value=f"{width} × {height}",
            limit=f"{rig.camera.width_px} × {rig.camera.height_px}",
            unit="px",
        )
    usable = np.isfinite(unwrapped_phase) & ~(np.asarray(phase_std) > params.max_phase_std_rad)
    measured = np.where(usable, np.asarray(unwrapped_phase, dtype=np.float64), np.nan)
    nothing = Debanded(measured, np.zeros(ORDERS), np.zeros(ORDERS), np.zeros(ORDERS), ())
    debanded = deband(measured, significance=params.deband_significance) if params.deband else nothing
    origin, direction = rays_of_camera(rig.camera.camera, pixel_grid(height, width))
    result = triangulate(origin, direction, debanded.unwrapped_phase, rig.projector)
    former = result if not debanded.orders_removed else triangulate(origin, direction, measured, rig.projector)
    noise = np.nan_to_num(np.asarray(phase_std, dtype=np.float64), nan=0.0)
    distance = np.linalg.norm(result.points - origin, axis=-1)
    distance[distance > _FARTHEST * float(np.linalg.norm(origin))] = np.nan
    mask = surface_mask(
        distance,
        pixel_angle=_pixel_angle(direction),
        distance_std=noise * np.linalg.norm(result.per_radian, axis=-1),
        max_slope_deg=params.max_slope_deg,
        min_piece_px=params.min_piece_px,
    )
    if not mask.any():
        raise CaptureProblem(
            "calibration",
            "measured_share",
            "No surface comes out of the scan's phase with this calibration. Check that the calibration belongs to "
            "this set-up and that nothing was moved between the two.",
            value=0.0,
            limit=0.0,
            unit="share",
        )
    z_std = np.hypot(noise * np.abs(result.per_radian[..., 2]), _calibration_std(rig, measured))
    points = np.where(mask[..., None], result.points, np.nan)
    warnings: list[str] = []
    return Cloud(
        points=points.astype(np.float32),
        points_before_debanding=np.where(mask[..., None], former.points, np.nan).astype(np.float32),
        z_std=np.where(mask, z_std, np.nan).astype(np.float32),
        normals=normals_of_grid(points, origin, radius=params.normal_radius_px).astype(np.float32),
        colour=_colour(points, mask, background, rig.texture_camera, photo, warnings),
        debanded=debanded,
        measured_share=float(mask.sum() / max(int(np.isfinite(unwrapped_phase).sum()), 1)),
        warnings=warnings,
    )


def _pixel_angle(direction: FloatArray) -> float:
    """Angle between neighbouring rays at the image's middle, rad."""
    row, column = direction.shape[0] // 2, direction.shape[1] // 2
    first, second = direction[row, column], direction[row, column + 1]
    return float(np.linalg.norm(np.cross(first, second)) / (np.linalg.norm(first) * np.linalg.norm(second)))


def _calibration_std(rig: Rig, unwrapped_phase: FloatArray) -> FloatArray:
    """Standard deviation (y, x) of Z from the calibration, mm: on a coarse grid of a smooth surface, interpolated."""
    height, width = unwrapped_phase.shape
    y, x = np.nonzero(np.isfinite(unwrapped_phase))
    some = slice(None, None, max(1, y.size // 5000))
    terms = _quadratic(x[some] / width, y[some] / height)
    surface = np.linalg.lstsq(terms, unwrapped_phase[y, x][some], rcond=None)[0]
    grid = pixel_grid(height, width, step=_UNCERTAINTY_STEP)
    smooth = (_quadratic(grid[..., 0].ravel() / width, grid[..., 1].ravel() / height) @ surface).reshape(grid.shape[:2])
    coarse = depth_std_from_calibration(rig.parameters, rig.covariance, rig.camera.camera.centre, grid, smooth)
    coarse = np.nan_to_num(coarse, nan=float(np.nanmedian(coarse)) if np.isfinite(coarse).any() else 0.0)
    place = pixel_grid(height, width).astype(np.float32) / np.float32(_UNCERTAINTY_STEP)
    fine = cv2.remap(
        coarse.astype(np.float32), place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(fine, dtype=np.float64)


def _quadratic(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _colour(
    points: FloatArray,
    mask: BoolArray,
    background: AnyArray,
    texture_camera: ImagingCamera | None,
    photo: ByteArray | None,
    warnings: list[str],
) -> ByteArray:
    """Colour (y, x, 3) of each point: the photo's where it sees the point, else the video's own grey."""
    level = np.nan_to_num(np.asarray(background, dtype=np.float64), nan=0.0)
    white = max(float(np.percentile(level[mask], 99.5)), 1e-9)
    grey = np.clip(level * (255.0 / white), 0.0, 255.0).astype(np.uint8)
    colour: ByteArray = np.repeat(grey[..., None], 3, axis=2)
    if photo is not None and texture_camera is None:
        warnings.append(
            "The calibration has no texture camera (no photo of the target): the colour is the video's grey."
        )
    elif photo is not None and texture_camera is not None:
        scale = np.array([photo.shape[1] / texture_camera.width_px, photo.shape[0] / texture_camera.height_px])
        if abs(scale[0] / scale[1] - 1.0) > 0.01:
            warnings.append(
                f"The texture photo has {photo.shape[1]} × {photo.shape[0]} pixels, the target's photo "
                f"{texture_camera.width_px} × {texture_camera.height_px}: the colour is the video's grey."
            )
        else:
            seen = (project(texture_camera.camera, points) + 0.5) * scale - 0.5
            inside = mask & np.all((seen >= 0) & (seen <= np.array(photo.shape[1::-1]) - 1), axis=-1)
            place = np.where(inside[..., None], seen, -1.0).astype(np.float32)
            sampled = cv2.remap(np.ascontiguousarray(photo), place[..., 0], place[..., 1], cv2.INTER_LINEAR)
            colour = np.where(inside[..., None], sampled, colour)
            if not inside[mask].any():
                warnings.append("The texture camera does not see the surface: the colour is the video's grey.")
    return np.where(mask[..., None], colour, 0).astype(np.uint8)
