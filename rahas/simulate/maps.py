"""Scene and rig → maps: what each camera pixel sees of the projector. The first half of the renderer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.simulate import raycast
from rahas.simulate.petroglyphs import petroglyph
from rahas.simulate.rig import Eye, Projector, pixel_rays, projector_of_rig, texture_eye, video_eye
from rahas.simulate.roof import roof
from rahas.simulate.shapes import metate, plain_body
from rahas.simulate.specs import CaptureSpec, RigSpec
from rahas.simulate.surface import ALBEDO_SPACING_MM, HEIGHT_SPACING_MM, Patch, Surface
from rahas.typing import BoolArray, Float32Array, FloatArray


class Maps(NamedTuple):
    """What a camera pixel sees, at the reference slide position (y, x); of a rendered scene or of a real object."""

    u: Float32Array
    v: Float32Array
    light: Float32Array
    """Lamp light × albedo, mean over the pixel; 0 in shadow; any unit."""
    albedo: Float32Array
    """Mean over the pixel, 0 to 1: what stray light shows."""
    slide_gradient: Float32Array | None
    """(y, x, 4): du/dx, du/dy, dv/dx, dv/dy per pixel at constant depth; what a shift of the object leaves in place."""
    points: Float32Array | None
    """Surface points (y, x, 3), scene's frame, mm."""


def surface_of(capture: CaptureSpec) -> Surface:
    """The scene's height field and albedo, a little larger than the cameras' view."""
    patch = patch_of(capture.rig)
    kind = capture.scene.kind
    if kind == "roof":
        return roof(capture.scene, capture.target, patch)
    if kind == "metate":
        return metate(capture.scene, patch)
    if kind in ("plane", "sphere", "steps"):
        return plain_body(capture.scene, patch)
    return petroglyph(capture.scene, patch)


def patch_of(rig: RigSpec) -> Patch:
    """The video camera's view at the working distance with a margin of a fifth."""
    half_width = rig.working_distance_mm / rig.focal_widths / 2
    return Patch(1.25 * half_width, 1.3 * half_width * rig.height_px / rig.width_px)


def seen_points(surface: Surface, eye: Eye, rays: FloatArray) -> FloatArray:
    """Where the rays (y, x, 2) meet the surface (y, x, 3)."""
    lengths = raycast.ray_lengths(surface.height, HEIGHT_SPACING_MM, eye.centre, rays, _steepest(surface.height))
    return np.asarray(
        eye.centre + lengths[..., None] * np.concatenate([rays, np.full_like(rays[..., :1], -1.0)], axis=-1)
    )


def albedo_at(surface: Surface, points: FloatArray) -> FloatArray:
    """Albedo at surface points (y, x)."""
    rows, columns = surface.albedo.shape
    return raycast.sample_map(
        surface.albedo,
        points[..., 0] / ALBEDO_SPACING_MM + (columns - 1) / 2,
        points[..., 1] / ALBEDO_SPACING_MM + (rows - 1) / 2,
    )


def lamp_light_at(surface: Surface, points: FloatArray, projector: Projector) -> FloatArray:
    """Lamp light arriving at surface points (y, x)."""
    far = float(np.linalg.norm(projector.centre))
    return raycast.lamp_light(surface.height, HEIGHT_SPACING_MM, points, projector.centre, projector.axes[2], far)


def slide_coordinates(points: FloatArray, projector: Projector) -> tuple[FloatArray, FloatArray]:
    """(u, v) at which points (…, 3) are seen from the projector, its lens taken as ideal."""
    right, down, forward = np.moveaxis((points - projector.centre) @ projector.axes.T, -1, 0)
    return right / forward / projector.tangent, down / forward / projector.tangent


def maps_of(capture: CaptureSpec, surface: Surface) -> Maps:
    """Trace the pixel centres for geometry and four points a pixel for light."""
    eye, projector = video_eye(capture.rig), projector_of_rig(capture.rig)
    rays = pixel_rays(eye)
    points = seen_points(surface, eye, rays)
    u, v = slide_coordinates(points, projector)
    light, albedo = np.zeros(u.shape), np.zeros(u.shape)
    for shift_x, shift_y in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        part = seen_points(surface, eye, pixel_rays(eye, shift_x=shift_x, shift_y=shift_y))
        part_albedo = albedo_at(surface, part)
        albedo += part_albedo / 4
        light += part_albedo * lamp_light_at(surface, part, projector) / 4
    return Maps(
        u=u.astype(np.float32),
        v=v.astype(np.float32),
        light=light.astype(np.float32),
        albedo=albedo.astype(np.float32),
        slide_gradient=_slide_gradient(eye, projector, rays, points),
        points=points.astype(np.float32),
    )


def lit_of(maps: Maps, rig: RigSpec) -> BoolArray:
    """Pixels (y, x) that the lamp reaches through the slide's aperture at the reference slide position."""
    bend = rig.projector_radial_k1 * np.tan(np.deg2rad(rig.half_field_deg)) ** 2
    swell = 1 + bend * (maps.u**2 + maps.v**2)
    inside = np.maximum(np.abs(maps.u), np.abs(maps.v)) * swell < rig.aperture
    return np.asarray(inside & (maps.light > 0.02 * maps.albedo))


def photo_of(capture: CaptureSpec, surface: Surface) -> Float32Array:
    """The texture camera's picture, linear, brightest about 0.8 (y, x, 3), red, green, blue; no stripes."""
    eye, projector = texture_eye(capture.rig), projector_of_rig(capture.rig)
    coarse = seen_points(surface, eye, pixel_rays(eye, binning=2))
    if capture.photo_light == "lamp":
        u, v = slide_coordinates(coarse, projector)
        light = lamp_light_at(surface, coarse, projector) * (np.maximum(np.abs(u), np.abs(v)) < capture.rig.aperture)
    else:
        flash = Projector(eye.centre + np.array([30.0, 60.0, 0.0]), np.diag([1.0, -1.0, -1.0]), 1.0)
        light = lamp_light_at(surface, coarse, flash)
    fine = raycast.enlarge(
        np.concatenate([coarse, light[..., None]], axis=-1).astype(np.float32), eye.height_px, eye.width_px
    )
    grey = albedo_at(surface, fine) * fine[..., 3]
    grey = grey * (0.8 / np.percentile(grey[::4, ::4], 99.5)) + 0.004
    return (grey[..., None] * np.array(surface.tint)).astype(np.float32)


def _slide_gradient(eye: Eye, projector: Projector, rays: FloatArray, points: FloatArray) -> Float32Array:
    depth = (eye.centre[2] - points[..., 2])[..., None]
    gradient = []
    for axis in (1, 0):
        slopes = np.gradient(rays, axis=axis) * depth
        step = np.concatenate([slopes, np.zeros_like(slopes[..., :1])], axis=-1) / 2
        ahead, behind = slide_coordinates(points + step, projector), slide_coordinates(points - step, projector)
        gradient.append((ahead[0] - behind[0], ahead[1] - behind[1]))
    (du_dx, dv_dx), (du_dy, dv_dy) = gradient
    return np.stack([du_dx, du_dy, dv_dx, dv_dy], axis=-1).astype(np.float32)


def _steepest(height: Float32Array) -> float:
    """The slope that the march allows for: nearly the steepest, cliffs aside (bisection finds their foot)."""
    slopes = np.maximum(np.abs(np.diff(height[::2], axis=1))[:, :].max(), np.abs(np.diff(height[:, ::2], axis=0)).max())
    return float(min(slopes / HEIGHT_SPACING_MM, 8.0))
