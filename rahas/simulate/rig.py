"""Geometry of camera, projector and target.

=============  ==========================================================================================
scene frame    x right, y up, z towards the camera, mm; the camera looks along −z from (0, 0, D)
target frame   the same axes turned with the target, origin at mark 1: the world of every result
pixel          x right, y down, pixel centres at integers, principal point at ((W−1)/2, (H−1)/2)
slide (u, v)   u right, v down as seen from the rig, ±1 at the half field; at the reference slide position
=============  ==========================================================================================
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.simulate.specs import PoseSpec, RigSpec
from rahas.typing import FloatArray


class Eye(NamedTuple):
    """A camera in the scene's frame."""

    centre: FloatArray
    turn: FloatArray
    """(3, 3): columns are its right, up and backwards."""
    focal_px: float
    width_px: int
    height_px: int
    radial_k1: float


class Projector(NamedTuple):
    """The slide projector in the scene's frame."""

    centre: FloatArray
    axes: FloatArray
    """(3, 3): rows right, down and forward."""
    tangent: float
    """Tangent of the half field: slide coordinate 1."""


def video_eye(rig: RigSpec) -> Eye:
    """The video camera."""
    centre = np.array([0.0, 0.0, rig.working_distance_mm])
    return Eye(centre, np.eye(3), rig.focal_widths * rig.width_px, rig.width_px, rig.height_px, rig.radial_k1)


def texture_eye(rig: RigSpec) -> Eye:
    """The texture camera: beside the first, turned to the same middle, more pixels, no distortion."""
    centre = np.array([rig.texture_offset_mm, 0.0, rig.working_distance_mm])
    width, height = round(rig.width_px * rig.texture_scale), round(rig.height_px * rig.texture_scale)
    yaw = np.arctan2(rig.texture_offset_mm, rig.working_distance_mm)
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return Eye(centre, turn, 0.95 * rig.focal_widths * width, width, height, 0.0)


def projector_of_rig(rig: RigSpec) -> Projector:
    """The projector: above the camera by the baseline, pitched down by the toe-in, turned with the baseline."""
    toe_in = (
        np.arctan2(rig.baseline_mm, rig.working_distance_mm) if rig.toe_in_deg is None else np.deg2rad(rig.toe_in_deg)
    )
    down = np.array([0.0, -np.cos(toe_in), np.sin(toe_in)])
    forward = np.array([0.0, -np.sin(toe_in), -np.cos(toe_in)])
    turn = rotation_about_z(rig.baseline_tilt_deg)
    yaw, roll = np.deg2rad(rig.projector_yaw_deg), np.deg2rad(rig.projector_roll_deg)
    about_down = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    about_axis = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    axes = about_axis @ about_down @ np.stack([np.array([1.0, 0.0, 0.0]), down, forward]) @ turn.T
    centre = np.array([0.0, 0.0, rig.working_distance_mm]) + turn @ np.array([0.0, rig.baseline_mm, 0.0])
    return Projector(centre, axes, float(np.tan(np.deg2rad(rig.half_field_deg))))


def rotation_about_z(angle_deg: float) -> FloatArray:
    """Counter-clockwise as the camera sees it (3, 3)."""
    angle = np.deg2rad(angle_deg)
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])


def target_rotation(pose: PoseSpec) -> FloatArray:
    """Target frame → scene frame (3, 3): yaw about y, then pitch about x, then roll about z."""
    yaw, pitch = np.deg2rad(pose.yaw_deg), np.deg2rad(pose.pitch_deg)
    about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    return rotation_about_z(pose.roll_deg) @ about_x @ about_y


def pixel_rays(eye: Eye, *, shift_x: float = 0.0, shift_y: float = 0.0, binning: int = 1) -> FloatArray:
    """Rays (y, x, 2): slope of x and y per mm of way towards the scene, of pixel centres moved by the shift.

    With ``binning`` n there is a ray for the middle of each n × n block of pixels.
    """
    middle = (binning - 1) / 2
    x = np.arange(0, eye.width_px, binning) + middle + shift_x - (eye.width_px - 1) / 2
    y = np.arange(0, eye.height_px, binning) + middle + shift_y - (eye.height_px - 1) / 2
    slopes = np.stack(np.broadcast_arrays(x[None, :] / eye.focal_px, -y[:, None] / eye.focal_px), axis=-1)
    ideal = slopes
    for _ in range(8 if eye.radial_k1 else 0):
        ideal = slopes / (1 + eye.radial_k1 * np.sum(ideal**2, axis=-1, keepdims=True))
    forward = np.concatenate([ideal, np.full_like(ideal[..., :1], -1.0)], axis=-1) @ eye.turn.T
    return np.ascontiguousarray(-forward[..., :2] / forward[..., 2:])


def camera_matrix(eye: Eye, rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """M^c (3, 4), target frame → undistorted pixels, m12 = 1 (thesis 2.9)."""
    focal, cx, cy = eye.focal_px, (eye.width_px - 1) / 2, (eye.height_px - 1) / 2
    inner = np.array([[focal, 0, -cx], [0, -focal, -cy], [0, 0, -1.0]])
    matrix = inner @ eye.turn.T @ np.hstack([rotation, (origin - eye.centre)[:, None]])
    return np.asarray(matrix / matrix[2, 3])


def projector_matrix(rig: RigSpec, projector: Projector, rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """M^p (2, 4), target frame → Φ / 2π at the reference slide position but for the lens, m12 = 1 (thesis 2.10)."""
    stop = np.deg2rad(rig.second_stop_deg)
    along = np.cos(stop) * projector.axes[0] + np.sin(stop) * projector.axes[1]
    constant = np.cos(stop) * rig.centre_u + np.sin(stop) * rig.centre_v
    constant -= rig.slide_shift_rad / (np.pi * rig.stripes)
    rows = rig.stripes / 2 * np.stack([along / projector.tangent - constant * projector.axes[2], projector.axes[2]])
    rows[1] *= 2 / rig.stripes
    matrix = rows @ np.hstack([rotation, (origin - projector.centre)[:, None]])
    return np.asarray(matrix / matrix[1, 3])
