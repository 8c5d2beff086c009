"""Maps + motion + camera → frames: the second half of the renderer. The maps may come from a real object."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from rahas.simulate.hand import Motion
from rahas.simulate.maps import Maps
from rahas.simulate.pattern import add_pattern, row_courses, shifted
from rahas.simulate.sensor import AutoExposure, code_table, exposed_frame
from rahas.simulate.specs import CameraSpec, RigSpec
from rahas.typing import ByteArray, Float32Array, IntArray

STILL_PX = 2e-3


def filmed_frames(camera: CameraSpec, duration_s: float) -> IntArray:
    """Number of the moment, as shot, that each frame of the file shows (frame,): doubled and dropped frames."""
    as_shot = np.arange(round(duration_s * camera.frame_rate))
    shows = as_shot.copy()
    for frame in sorted(camera.doubled):
        if 0 < frame < len(shows):
            shows[frame] = shows[frame - 1]
    return shows[~np.isin(as_shot, camera.dropped)]


def field_delays(camera: CameraSpec) -> list[tuple[int, int, float]]:
    """(first row, row step, seconds after the frame's start) of each field of a frame, in order of time."""
    if camera.fields == "progressive":
        return [(0, 1, 0.0)]
    first = 0 if camera.fields == "top_first" else 1
    return [(first, 2, 0.0), (1 - first, 2, 0.5 / camera.frame_rate)]


def render_frames(
    maps: Maps, rig: RigSpec, motion: Motion, camera: CameraSpec, *, shows: IntArray, seed: int
) -> Iterator[ByteArray]:
    """Frames (y, x) uint8, one by one, the same for the same seed.

    ``shows`` (frame,) is the number, as shot, of what each frame of the film shows.
    """
    light = maps.light * np.float32(camera.peak / np.percentile(maps.light, 99.5))
    scene = maps._replace(light=light)
    table, height = code_table(camera), light.shape[0]
    regulator = AutoExposure(camera, usual_light=0.5 * float(light.mean()))
    row_delay = np.arange(height) / height * camera.readout_s
    lamp_light, stray = np.zeros_like(light), maps.albedo.copy()
    shown, latest = -1, np.zeros(light.shape, np.uint8)
    before = [np.empty(0), np.empty(0)]
    for frame in shows:
        if frame == shown:
            yield latest
            continue
        shown, start = int(frame), frame / camera.frame_rate
        for field, (first, step, delay) in enumerate(field_delays(camera)):
            begin = start + delay + row_delay
            rows = row_courses(motion, begin, begin + camera.exposure_s)
            middle = np.array([start + delay + camera.exposure_s / 2])
            jitter = (float(motion.at("jitter_x", middle)[0]), float(motion.at("jitter_y", middle)[0]))
            state = np.append(rows.ravel(), jitter)
            if not np.array_equal(state, before[field]):
                u, v, lamp_map, albedo = _moved(scene, jitter)
                add_pattern(lamp_light, (u, v, lamp_map), rig, rows, first=first, step=step)
                stray[first::step] = albedo[first::step]
                before[field] = state
        flicker = 1 + camera.flicker * math.sin(2 * math.pi * camera.flicker_hz * start)
        drift = 1 + camera.ambient_drift * start / motion.time_s[-1]
        gain = regulator.gain_for(flicker * float(lamp_light[::8, ::8].mean()))
        latest = exposed_frame(
            lamp_light if flicker == 1 else lamp_light * np.float32(flicker),
            stray,
            camera=camera,
            table=table,
            gain=gain,
            stray_level=camera.ambient * drift,
            seed=(seed, shown),
        )
        yield latest


def _moved(scene: Maps, jitter: tuple[float, float]) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """(u, v, light, albedo) with the object displaced by ``jitter`` px while the pattern stays with the rig."""
    x, y = jitter
    if math.hypot(x, y) < STILL_PX:
        return scene.u, scene.v, scene.light, scene.albedo
    u, v, light, albedo = (shifted(m, x, y) for m in (scene.u, scene.v, scene.light, scene.albedo))
    if scene.slide_gradient is not None:
        g = scene.slide_gradient
        u += np.float32(x) * g[..., 0] + np.float32(y) * g[..., 1]
        v += np.float32(x) * g[..., 2] + np.float32(y) * g[..., 3]
    return u, v, np.maximum(light, 0), np.clip(albedo, 0, 1)
