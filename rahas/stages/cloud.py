"""From unwrapped phase and a calibrated rig to a coloured cloud on the camera's grid (thesis 2.3.2, 4.6)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.banding import ORDERS, Debanded, deband
from rahas.kernels.camera import project
from rahas.kernels.resolution import image_scale
from rahas.kernels.rig_uncertainty import depth_std_from_calibration
from rahas.kernels.surface import normals_of_grid, surface_mask
from rahas.kernels.triangulation import pixel_grid
from rahas.params import CloudParams
from rahas.stages.rig import ImagingCamera, Rig
from rahas.stages.surface_points import pixel_angle, points_of, row_bands, surface_points
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
    finer = image_scale(height, width)
    usable = np.isfinite(unwrapped_phase) & ~(np.asarray(phase_std) > params.max_phase_std_rad)
    measured = np.where(usable, unwrapped_phase, np.float32(np.nan)).astype(np.float32, copy=False)
    nothing = Debanded(measured, np.zeros(ORDERS), np.zeros(ORDERS), np.zeros(ORDERS), ())
    debanded = deband(measured, significance=params.deband_significance) if params.deband else nothing
    result = surface_points(rig, debanded.unwrapped_phase, phase_std)
    origin = rig.camera.camera.origin
    result.distance[result.distance > _FARTHEST * float(np.linalg.norm(origin))] = np.nan
    mask = surface_mask(
        result.distance,
        pixel_angle=pixel_angle(rig),
        distance_std=result.distance_std,
        max_slope_deg=params.max_slope_deg,
        min_piece_px=round(params.min_piece_px * finer**2),
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
    points, z_std = result.points, np.hypot(result.z_std, _calibration_std(rig, measured))
    former = points_of(rig, measured) if debanded.orders_removed else points
    for values in (points, former, z_std):
        values[~mask] = np.nan
    warnings: list[str] = []
    return Cloud(
        points=points,
        points_before_debanding=former,
        z_std=z_std,
        normals=normals_of_grid(points, origin, radius=round(params.normal_radius_px * finer)),
        colour=_colour(points, mask, background, rig.texture_camera, photo, warnings),
        debanded=debanded,
        measured_share=float(mask.sum() / max(int(np.isfinite(unwrapped_phase).sum()), 1)),
        warnings=warnings,
    )


def _calibration_std(rig: Rig, unwrapped_phase: AnyArray) -> Float32Array:
    """Standard deviation (y, x) of Z from the calibration, mm: on a coarse grid of a smooth surface, interpolated."""
    height, width = unwrapped_phase.shape
    known = np.flatnonzero(np.isfinite(unwrapped_phase))
    y, x = np.divmod(known[:: max(1, known.size // 5000)], width)
    surface = np.linalg.lstsq(_quadratic(x / width, y / height), unwrapped_phase[y, x].astype(float), rcond=None)[0]
    grid = pixel_grid(height, width, step=_UNCERTAINTY_STEP)
    smooth = (_quadratic(grid[..., 0].ravel() / width, grid[..., 1].ravel() / height) @ surface).reshape(grid.shape[:2])
    coarse = depth_std_from_calibration(
        rig.parameters,
        rig.covariance,
        rig.camera.camera.centre,
        grid,
        smooth,
        projector_centre=rig.lens.centre,
    )
    coarse = np.nan_to_num(coarse, nan=float(np.nanmedian(coarse)) if np.isfinite(coarse).any() else 0.0)
    coarse, fine = coarse.astype(np.float32), np.empty((height, width), np.float32)
    for rows in row_bands(height, width):
        across, down = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[rows])
        place = across / np.float32(_UNCERTAINTY_STEP), down / np.float32(_UNCERTAINTY_STEP)
        fine[rows] = cv2.remap(coarse, *place, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return fine


def _quadratic(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _colour(
    points: Float32Array,
    mask: BoolArray,
    background: AnyArray,
    texture_camera: ImagingCamera | None,
    photo: ByteArray | None,
    warnings: list[str],
) -> ByteArray:
    """Colour (y, x, 3) of each point: the photo's where it sees the point, else the video's own grey."""
    level = np.nan_to_num(np.asarray(background, dtype=np.float32), nan=0.0)
    white = max(float(np.percentile(level[mask], 99.5)), 1e-9)
    level *= np.float32(255.0 / white)
    grey = np.clip(level, 0.0, 255.0, out=level).astype(np.uint8)
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
            anything = False
            for rows in row_bands(*mask.shape):
                seen = (project(texture_camera.camera, points[rows].astype(np.float64)) + 0.5) * scale - 0.5
                inside = mask[rows] & np.all((seen >= 0) & (seen <= np.array(photo.shape[1::-1]) - 1), axis=-1)
                place = np.where(inside[..., None], seen, -1.0).astype(np.float32)
                sampled = cv2.remap(np.ascontiguousarray(photo), place[..., 0], place[..., 1], cv2.INTER_LINEAR)
                colour[rows][inside] = sampled[inside]
                anything |= bool(inside.any())
            if not anything:
                warnings.append("The texture camera does not see the surface: the colour is the video's grey.")
    colour[~mask] = 0
    return colour
