"""A plain synthetic capture for the review's own tests: a textured surface under turning and moving stripes.

No optics: the albedo is shifted by the object's displacement, the pattern stays with the rig.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from rahas.typing import AnyArray, FloatArray


@dataclass(frozen=True)
class Scene:
    """What is filmed, and how; lengths in pixels, light in grey levels."""

    width: int = 360
    height: int = 240
    pitch: float = 22.0
    periods: float = 1.4
    modulation: float = 0.9
    light: float = 90.0
    texture: float = 0.12
    noise: float = 1.5
    span: float = 1.0
    surroundings: float = 0.0
    flicker: float = 0.0
    black: float = 4.0
    hold: int = 12
    rotation: int = 60
    scan: int = 60
    seed: int = 1


@dataclass(frozen=True)
class Capture:
    """Frames with their truth."""

    frames: AnyArray
    time_s: FloatArray
    timeline: dict[str, Any]
    displacement: FloatArray
    """(frame, 2) pixels, x and y."""

    @property
    def moving(self) -> slice:
        """From the start of the rotation to the end of the scan."""
        stages = {entry["stage"]: entry for entry in self.timeline["intervals"]}
        return slice(stages["rotation"]["first"], stages["scan"]["last"] + 1)


def fractal(height: int, width: int, *, seed: int, finest: float = 1.0) -> AnyArray:
    """Rock-like texture, mean 0, standard deviation 1."""
    noise = np.random.default_rng(seed).standard_normal((height, width)).astype(np.float32)
    total = np.zeros_like(noise)
    for octave in range(6):  # the finest carries as much as the coarsest
        sigma = finest * 2.0**octave
        layer = cv2.GaussianBlur(noise[:, ::-1] if octave % 2 else noise, (0, 0), sigma)
        total += layer / layer.std()
    return (total - total.mean()) / total.std()


def bump(frames: int, *, start: int, amplitude: float, frequency_hz: float = 4.0, decay_s: float = 1.5) -> FloatArray:
    """Displacement (frame, 2) of a bounce that begins at frame ``start`` and decays."""
    time = np.maximum(np.arange(frames) - start, 0) / 30.0
    swing = amplitude * np.exp(-time / decay_s) * (np.arange(frames) >= start)
    return np.stack(
        [swing * np.cos(2 * np.pi * frequency_hz * time), 0.35 * swing * np.sin(2 * np.pi * frequency_hz * time)], 1
    )


def film(scene: Scene, displacement: FloatArray | None = None) -> Capture:
    """Frames of the whole sequence: dark 5, hold, rotation, hold, scan, hold."""
    rng = np.random.default_rng(scene.seed)
    counts = [
        ("dark", 5),
        ("hold", scene.hold),
        ("rotation", scene.rotation),
        ("hold", scene.hold),
        ("scan", scene.scan),
        ("hold", scene.hold),
    ]
    intervals, first = [], 0
    for stage, count in counts:
        intervals.append({"stage": stage, "first": first, "last": first + count - 1})
        first += count
    total = first
    starts = [entry["first"] for entry in intervals]
    angle = np.interp(np.arange(total), [starts[2] - 1, starts[3]], [0.0, 90.0])
    turn = 2 * np.pi * scene.periods
    ease = np.clip((np.arange(total) - starts[4] + 1) / (scene.scan + 1), 0, 1)
    step = turn * (ease - 0.08 * np.sin(2 * np.pi * ease))
    moved = np.zeros((total, 2)) if displacement is None else displacement[:total]
    edge = 24
    albedo = np.exp(scene.texture * fractal(scene.height + 2 * edge, scene.width + 2 * edge, seed=scene.seed))
    y, x = np.mgrid[: scene.height, : scene.width].astype(np.float32)
    relief = 6.0 * np.sin(2 * np.pi * x / scene.width) * np.cos(2 * np.pi * y / scene.height)
    share = np.where(np.abs(x - scene.width / 2 + 0.5) <= scene.span * scene.width / 2, 1.0, scene.surroundings)
    share = share * (np.abs(y - scene.height / 2 + 0.5) <= 0.45 * scene.height)
    vignette = 1.0 - 0.3 * (((x / scene.width - 0.5) ** 2) + ((y / scene.height - 0.5) ** 2))
    frames = np.zeros((total, scene.height, scene.width), np.uint8)
    for n in range(total):
        shift = np.float32([[1, 0, moved[n, 0] - edge], [0, 1, moved[n, 1] - edge]])
        shown = cv2.warpAffine(albedo.astype(np.float32), shift, (scene.width, scene.height), flags=cv2.INTER_CUBIC)
        turned = np.radians(angle[n])
        along = (x - scene.width / 2) * np.cos(turned) + (y - scene.height / 2 + relief) * np.sin(turned)
        stripes = 1.0 + scene.modulation * np.cos(2 * np.pi * along / scene.pitch + step[n])
        lamp = 0.0 if n < 5 else scene.light * (1.0 + scene.flicker * rng.standard_normal())
        exposed = scene.black + lamp * 0.5 * shown * vignette * share * stripes
        sigma = scene.noise * np.sqrt(1.0 + exposed / 100.0)
        frames[n] = np.clip(np.round(exposed + sigma * rng.standard_normal(exposed.shape)), 0, 255)
    scanned = slice(starts[4], starts[5])
    timeline = {
        "intervals": intervals,
        "frames": total,
        "frame_rate": 30.0,
        "duplicates": [],
        "dropped": [],
        "phase_step_rad": [float(step[n]) if scanned.start <= n < scanned.stop else None for n in range(total)],
        "slide_angle_deg": [float(value) for value in angle],
        "periods": float(scene.periods),
    }
    return Capture(frames, np.arange(total) / 30.0, timeline, moved)
