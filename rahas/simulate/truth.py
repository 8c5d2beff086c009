"""What a capture's frames really show: read by tests and benches, never by the workflow."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from rahas.simulate.frames import field_delays
from rahas.simulate.hand import Motion
from rahas.simulate.maps import Maps, lit_of
from rahas.simulate.pattern import pattern_phase
from rahas.simulate.rig import (
    camera_matrix,
    projector_matrix,
    projector_of_rig,
    target_rotation,
    texture_eye,
    video_eye,
)
from rahas.simulate.roof import target_origin
from rahas.simulate.specs import CaptureSpec
from rahas.typing import AnyArray, BoolArray, FloatArray, IntArray

OFF_STOP_DEG = 0.5
OFF_HOLD_RAD = 0.05


def field_centre(maps: Maps) -> tuple[float, float]:
    """Slide coordinates (u, v) at the middle of the image: median over a small patch."""
    row, column = maps.u.shape[0] // 2, maps.u.shape[1] // 2
    patch = (slice(row - 8, row + 8), slice(column - 8, column + 8))
    return float(np.median(maps.u[patch])), float(np.median(maps.v[patch]))


def stages_of(lamp_on: BoolArray, theta_deg: FloatArray, step: FloatArray) -> list[str]:
    """Stage of each frame by the contract: rotation from 0.5° off the first stop to 0.5° off the second,
    scan from 0.05 rad off the hold before to 0.05 rad off the hold after, both ends included."""
    stages = np.where(lamp_on, "hold", "dark").astype("<U8")
    turning = np.flatnonzero((theta_deg - theta_deg[0] >= OFF_STOP_DEG) & (theta_deg[-1] - theta_deg >= OFF_STOP_DEG))
    if len(turning):
        stages[turning[0] : turning[-1] + 1] = "rotation"
    moving = np.flatnonzero((np.abs(step) >= OFF_HOLD_RAD) & (np.abs(step - step[-1]) >= OFF_HOLD_RAD))
    if len(moving):
        stages[moving[0] : moving[-1] + 1] = "scan"
    return [str(stage) for stage in stages]


def intervals_of(stages: list[str]) -> list[dict[str, Any]]:
    """Runs of one stage, as in timeline.json: ``stage``, ``first``, ``last``, both inclusive."""
    edges = [0, *(n for n in range(1, len(stages)) if stages[n] != stages[n - 1]), len(stages)]
    return [{"stage": stages[a], "first": a, "last": b - 1} for a, b in pairwise(edges)]


def truth_of(capture: CaptureSpec, maps: Maps, motion: Motion, shows: IntArray) -> dict[str, AnyArray]:
    """Everything known of a capture; maps (y, x) at the reference position, courses (frame,) or (field, frame).

    Courses hold for the middle of the exposure; ``theta`` in rad, ``phase_step`` at the field's centre in rad,
    ``jitter`` (frame, 2) in px; of an interlaced capture they are the first field's, those of both are in ``field_…``.
    """
    rig, camera = capture.rig, capture.camera
    middle = shows / camera.frame_rate + camera.exposure_s / 2 + camera.readout_s / 2
    times = np.stack([middle + delay for _, _, delay in field_delays(camera)])
    theta, crank = motion.at("theta", times), motion.at("crank", times)
    centre = field_centre(maps)
    stop = float(motion.theta[-1])
    step = pattern_phase(rig, *centre, theta=stop, crank=crank) - pattern_phase(rig, *centre, theta=stop, crank=0.0)
    lamp_on = motion.at("lamp", times[0]) > 0.5
    intervals = intervals_of(stages_of(lamp_on, np.rad2deg(theta[0]), step[0]))
    rotation, origin = target_rotation(capture.target), target_origin(capture.target)
    truth: dict[str, AnyArray] = {
        "u": maps.u,
        "v": maps.v,
        "lit": lit_of(maps, rig),
        "albedo": maps.albedo,
        "light": maps.light,
        "unwrapped_phase": _phase_map(capture, maps, stop),
        "first_phase": _phase_map(capture, maps, float(motion.theta[0])),
        "shows": shows,
        "lamp_on": lamp_on,
        "theta": theta[0],
        "crank": crank[0],
        "phase_step": step[0],
        "jitter": np.stack([motion.at("jitter_x", times[0]), motion.at("jitter_y", times[0])], axis=-1),
        "field_theta": theta,
        "field_crank": crank,
        "field_phase_step": step,
        "interval_stage": np.array([i["stage"] for i in intervals]),
        "interval_first": np.array([i["first"] for i in intervals]),
        "interval_last": np.array([i["last"] for i in intervals]),
        "camera_matrix": camera_matrix(video_eye(rig), rotation, origin),
        "texture_matrix": camera_matrix(texture_eye(rig), rotation, origin),
        "projector_matrix": projector_matrix(rig, projector_of_rig(rig), rotation, origin),
        "radial_k1": np.array(rig.radial_k1),
        "projector_radial_k1": np.array(rig.projector_radial_k1),
        "stripes": np.array(rig.stripes),
        "verdict": np.array(capture.expected),
        "rule": np.array(capture.expected_rule),
    }
    if maps.points is not None:
        truth["world_target"] = ((maps.points - origin) @ rotation).astype(np.float32)
    return truth


def _phase_map(capture: CaptureSpec, maps: Maps, theta: float) -> AnyArray:
    u, v = maps.u.astype(np.float64), maps.v.astype(np.float64)
    return pattern_phase(capture.rig, u, v, theta=theta, crank=0.0).astype(np.float32)
