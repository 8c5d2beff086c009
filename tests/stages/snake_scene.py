"""Small rendered captures with truth, for the snakes: a relief under a turning and then sliding cosine pattern."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.unrotation import canvas_columns
from rahas.stages.snakes import SnakeBlock, SnakeTimeline
from rahas.typing import AnyArray, BoolArray, FloatArray

HOLD, ROTATION, SCAN = 6, 44, 24


class Scene(NamedTuple):
    """Slide coordinates and light of each pixel at the reference position."""

    u: FloatArray
    v: FloatArray
    lit: BoolArray
    albedo: FloatArray
    stripes: int
    edge: BoolArray
    """Pixels within 2 px of a depth step or of a shadow, where the image mixes two surfaces."""


class Capture(NamedTuple):
    frames: AnyArray
    phase: FloatArray  # (frame, y, x) true pattern phase
    timeline: SnakeTimeline
    edge: BoolArray


def scene(relief: str, *, height: int = 180, width: int = 240, stripes: int = 16, rise: float = 0.8) -> Scene:
    """``rise``: depth of the relief, in stripes of displacement at phase alignment."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:height, :width].astype(float)
    size = max(height, width)
    lit = np.ones((height, width), bool)
    block = (np.abs(x - 0.5 * width) < 0.2 * width) & (np.abs(y - 0.45 * height) < 0.2 * height)
    shapes = {
        "flat": np.zeros_like(x),
        "wave": np.sin(4 * np.pi * x / width) * np.cos(2 * np.pi * y / height),
        "step": (x > 0.55 * width).astype(float),
        "block": block.astype(float),
    }
    if relief == "block":
        lit &= ~((np.abs(x - 0.5 * width) < 0.2 * width) & (np.abs(y - 0.68 * height) < 0.03 * height))
    rough = cv2.GaussianBlur(rng.normal(size=x.shape), (0, 0), size / 40)
    shape = shapes[relief] * rise + 0.06 * rough / rough.std()
    u = (x - width / 2) / size * 1.6
    v = (y - height / 2) / size * 1.6 + shape * 2 / stripes
    albedo = np.exp(2.0 * cv2.GaussianBlur(rng.normal(size=x.shape), (0, 0), 3))
    steps = np.abs(cv2.Laplacian(np.rint(shapes[relief]), cv2.CV_64F)) > 0 if relief in ("step", "block") else ~lit
    edge = cv2.dilate((steps | ~lit).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return Scene(u, v, lit, np.clip(albedo, 0.4, 2.0), stripes, edge)


def film(what: Scene, *, sense: int = 1, level: float = 45.0, noise: float = 1.0, dark: int = 2) -> Capture:
    """Dark frames, hold, rotation, hold, 1.4 periods of scan, hold; 8 bit."""
    rng = np.random.default_rng(3)

    def eased(n: int) -> FloatArray:
        return 0.5 - 0.5 * np.cos(np.pi * np.arange(n) / (n - 1))

    stop = 0.5 * np.pi
    theta = np.r_[np.zeros(HOLD), eased(ROTATION) * stop, np.full(HOLD + SCAN + HOLD, stop)]
    slide = np.r_[np.zeros(2 * HOLD + ROTATION), eased(SCAN), np.ones(HOLD)] * 1.4 * 2 / what.stripes
    frames = [np.full(what.u.shape, 3, np.uint8)] * dark
    phases = [np.full(what.u.shape, np.nan)] * dark
    for angle, moved in zip(theta, slide, strict=True):
        across = (sense * what.u - 0.03) * np.cos(angle) + (what.v - moved + 0.02) * np.sin(angle)
        phase = np.pi * what.stripes * across
        light = 0.15 + what.lit * (1 + 0.85 * np.cos(phase))
        shot = level * what.albedo * light + 5 + rng.normal(0, noise, phase.shape)
        frames.append(np.clip(np.rint(shot), 0, 255).astype(np.uint8))
        phases.append(phase)
    turn = (dark + HOLD, dark + HOLD + ROTATION - 1)
    scan = (turn[1] + HOLD + 1, turn[1] + HOLD + SCAN)
    angles = np.r_[np.full(dark, np.nan), np.rad2deg(theta)]
    timeline = SnakeTimeline(
        slide_angle_deg=angles,
        rotation_sense=sense,
        first_hold=(dark, turn[0] - 1),
        second_hold=(turn[1] + 1, scan[0] - 1),
        moving=(turn, scan),
        lit=np.isfinite(angles),
    )
    return Capture(np.stack(frames), np.stack(phases), timeline, what.edge)


class Score(NamedTuple):
    wrong: float
    """Share of snake pixels whose identity is not that of the first frame's stripe."""
    p95_px: float
    """95th percentile of the distance to the true maximum."""
    coverage: FloatArray
    """(frame scored) snake pixels over true maxima of stripes from the topmost labelled one down."""
    topmost: list[int]
    """Smallest identity of each frame scored."""


def score(shot: Capture, blocks: list[SnakeBlock], unrotation_deg: FloatArray, pitch_px: float) -> Score:
    """Snakes beside the true phase; mixed pixels are left out."""
    identity = np.concatenate([b.identity for b in blocks])
    rows = np.concatenate([b.y for b in blocks])
    shift = None
    wrong, off, coverage, topmost = [], [], [], []
    for n in range(shot.timeline.first_hold[0], len(shot.frames), 3):
        phase = canvas_columns(shot.phase[n].astype(np.float32), unrotation_deg[n])
        seen = canvas_columns((~shot.edge).astype(np.float32), unrotation_deg[n]) > 0.999
        k, x = np.nonzero(identity[n])
        y = rows[n, k, x]
        whole = np.clip(np.rint(y).astype(int), 1, phase.shape[1] - 2)
        good = seen[x, whole]
        k, x, y, whole = k[good], x[good], y[good], whole[good]
        slope = np.clip((phase[x, whole + 1] - phase[x, whole - 1]) / 2, 0, 4 * np.pi / pitch_px)
        turns = (phase[x, whole] + slope * (y - whole)) / (2 * np.pi)
        order = np.rint(turns)
        if shift is None:
            shift = int(np.median(k - order))
        wrong.append((k - order) != shift)
        off.append(np.abs(turns - order) * pitch_px)
        count = np.floor(phase / (2 * np.pi))
        crossing = (count[:, 1:] == count[:, :-1] + 1) & seen[:, 1:] & seen[:, :-1]
        coverage.append(k.size / max(1, int((crossing & (count[:, 1:] + shift >= 0)).sum())))
        topmost.append(int(k.min()) + 1)
    return Score(
        float(np.concatenate(wrong).mean()), float(np.percentile(np.concatenate(off), 95)), np.array(coverage), topmost
    )
