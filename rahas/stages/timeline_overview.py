"""First look at a capture: which frames are lit, and when roughly the stripes turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.frame_blocks import frame_blocks
from rahas.kernels.frame_runs import running_median, runs
from rahas.kernels.orientation import gradient_direction_deg, gradient_tensors
from rahas.kernels.pattern_light import FrameChange, PatternLight, frame_change, path_weights, pattern_light
from rahas.typing import FloatArray, FrameStack

ENOUGH = "lamp on, hold, rotation, hold, scan"
"""What a capture has to show."""


class Overview(NamedTuple):
    """What the whole capture tells without any model of the motion."""

    change: FrameChange
    """Frame to frame change where the pattern shines."""
    light: PatternLight
    lit_first: int
    lit_last: int
    sense: int
    """+1: the phase gradient turns from +x to +y; −1: from −x to +y."""
    turn_first: int
    """Frame near the beginning of the turn, some 10° into it."""
    turn_last: int
    """Frame near its end, some 10° before it."""


def timeline_problem(message: str, found: str) -> CaptureProblem:
    """A stage of the capture is missing."""
    return CaptureProblem("timeline", "stages", message, value=found, limit=ENOUGH)


def look_over(thumbnails: FrameStack, *, scale: float) -> Overview:
    """Lit frames and the rough extent of the turn, from thumbnails (frame, y, x) times ``scale`` in grey levels.

    Raises
    ------
    CaptureProblem
        Nothing moves, the lamp is never on, or the stripes do not turn by a right angle.
    """
    if thumbnails.shape[0] < 10:
        raise timeline_problem(
            f"The capture has {thumbnails.shape[0]} frames: too short to hold a rotation and a scan. "
            "Film the whole sequence.",
            f"{thumbnails.shape[0]} frames",
        )
    change = frame_change(thumbnails, scale=scale)
    light = pattern_light(thumbnails, path_weights(change), noise=change.noise, scale=scale)
    change = frame_change(thumbnails, scale=scale, weight=light.weight)
    light = pattern_light(thumbnails, path_weights(change), noise=change.noise, scale=scale)
    tensors = stripe_tensors(thumbnails, light, scale=scale) - noise_tensor(thumbnails, change, light, scale=scale)
    lit_first, lit_last = lit_frames(tensors, path_weights(change))
    return Overview(change, light, lit_first, lit_last, *_turn(tensors[lit_first : lit_last + 1], lit_first))


def stripe_tensors(
    thumbnails: FrameStack, light: PatternLight, *, scale: float, first: int = 0, stop: int | None = None
) -> FloatArray:
    """Structure tensors (frame, 3) of the stripes alone: each frame less its background light, over the contrast."""
    stop = thumbnails.shape[0] if stop is None else stop
    tensors = np.empty((stop - first, 3))
    matched = light.weight * light.inverse**2 * light.background
    matched = matched / max(float((matched * light.background).sum()), float(np.finfo(np.float32).tiny))
    for frames, values in frame_blocks(thumbnails, first=first, stop=stop, scale=scale):
        level = np.tensordot(values, matched, 2).astype(np.float32)
        values -= level[:, None, None] * light.background
        values *= light.inverse
        tensors[frames.start - first : frames.stop - first] = gradient_tensors(values, light.weight)
    return tensors


def noise_tensor(thumbnails: FrameStack, change: FrameChange, light: PatternLight, *, scale: float) -> FloatArray:
    """The part of a structure tensor that noise makes, (3), from the quietest pairs of frames."""
    rms = np.where(change.rms > 0, change.rms, np.inf)
    quiet = [int(n) for n in np.argsort(rms)[:8] if np.isfinite(rms[n])]
    if not quiet:
        return np.zeros(3)
    pairs = [np.diff(thumbnails[n - 1 : n + 1].astype(np.float32), axis=0) * np.float32(scale) for n in quiet]
    return gradient_tensors(np.concatenate(pairs) * light.inverse * np.float32(np.sqrt(0.5)), light.weight).mean(0)


def lit_frames(tensors: FloatArray, path: FloatArray) -> tuple[int, int]:
    """First and last frame that show the stripes at half their usual strength or more."""
    strength = np.sqrt(np.clip(tensors[:, 0] + tensors[:, 2], 0, None))
    moving = path > 0.3 * path.max()
    usual = float(np.median(strength[moving])) if moving.any() and path.max() > 0 else 0.0
    lit = [run for run in runs(strength > 0.5 * usual) if run[1] - run[0] >= 2]
    if usual <= 0 or not lit:
        raise timeline_problem(
            "No moving stripes were found: the lamp was off, the pattern out of focus, or neither lever nor crank was "
            "moved. Look through the camera while turning the lever before filming.",
            "no moving stripes",
        )
    return lit[0][0], lit[-1][1]


def _turn(tensors: FloatArray, offset: int) -> tuple[int, int, int]:
    """Sense and rough extent of the turn."""
    tensors = np.stack([running_median(part, 5) for part in tensors.T], axis=1)
    direction = np.degrees(np.unwrap(2 * np.radians(gradient_direction_deg(tensors)))) / 2
    ends = max(1, min(len(direction) // 4, 15))
    turned = float(np.median(direction[-ends:]) - np.median(direction[: min(5, ends)]))
    if abs(turned) < 65 or abs(turned) > 115:
        upright = abs((np.median(direction[:5]) + 90) % 180 - 90) < 45
        found = f"stripes turned by {abs(turned):.0f}°"
        if abs(turned) < 30 and not upright:
            raise timeline_problem(
                "The stripes lie across from the first frame on: the recording began after the lever had been turned. "
                "Start filming with the lever at its first stop (stripes upright), then turn it, then crank.",
                found,
            )
        raise timeline_problem(
            f"The stripes turned by {abs(turned):.0f}° instead of a right angle: the lever did not go from stop to "
            "stop. Start with the lever at its first stop (stripes upright) and turn it all the way before cranking.",
            found,
        )
    progress = (direction - np.median(direction[: min(5, ends)])) / turned * 90
    middle = int(np.argmax(progress > 45))
    before, after = np.flatnonzero(progress[:middle] < 12), np.flatnonzero(progress[middle:] > 78)
    first = int(before[-1]) if before.size else 0
    last = middle + int(after[0]) if after.size else len(progress) - 1
    return (1 if turned > 0 else -1), offset + first, offset + last
