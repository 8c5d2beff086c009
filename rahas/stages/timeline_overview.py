"""First look at a capture: which frames are lit, and when roughly the stripes turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.frame_blocks import frame_blocks
from rahas.kernels.frame_runs import running_median, runs
from rahas.kernels.orientation import StripeTensors, gradient_direction_deg, stripe_tensors
from rahas.kernels.pattern_light import (
    FrameChange,
    PatternLight,
    frame_change,
    path_weights,
    pattern_light,
    quiet_noise,
)
from rahas.typing import FloatArray, FrameStack

ENOUGH = "lamp on, hold, rotation, hold, scan"
"""What a capture has to show."""
UNLIT = -0.8
"""A frame this much darker than the pattern's mean, in contrasts, has no lamp: some -1.4, lit ones stay above -0.5."""


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


def no_stripes() -> CaptureProblem:
    """Nothing in the capture moves, or it is too faint to see."""
    return timeline_problem(
        "No moving stripes were found: the lamp was off, the pattern out of focus, or neither lever nor crank was "
        "moved. Look through the camera while turning the lever before filming.",
        "no moving stripes",
    )


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
    if not light.weight.max() > 0:
        raise no_stripes()
    change = frame_change(thumbnails, scale=scale, weight=light.weight)
    light = pattern_light(thumbnails, path_weights(change), noise=change.noise, scale=scale)
    if not light.weight.max() > 0:
        raise no_stripes()
    frames = thumbnails.shape[0]
    noise = noise_tensors(thumbnails, change.rms, light, scale=scale, first=0, stop=frames)
    tensors = tensors_of(thumbnails, light, scale=scale).less(noise).tensor
    lit_first, lit_last = lit_frames(tensors, brightness_off_mean(thumbnails, light, scale=scale), path_weights(change))
    change = change._replace(noise=quiet_noise(change.rms[lit_first + 1 : lit_last + 1]))
    return Overview(change, light, lit_first, lit_last, *_turn(tensors[lit_first : lit_last + 1], lit_first))


def tensors_of(
    thumbnails: FrameStack, light: PatternLight, *, scale: float, first: int = 0, stop: int | None = None
) -> StripeTensors:
    """Structure tensors of the stripes alone: each frame less its background light, over the contrast."""
    stop = thumbnails.shape[0] if stop is None else stop
    matched = light.weight * light.inverse**2 * light.background
    matched = matched / max(float((matched * light.background).sum()), float(np.finfo(np.float32).tiny))
    parts = []
    for _, values in frame_blocks(thumbnails, first=first, stop=stop, scale=scale):
        level = np.tensordot(values, matched, 2).astype(np.float32)
        values -= level[:, None, None] * light.background
        values *= light.inverse
        parts.append(stripe_tensors(values, light.weight))
    return StripeTensors(
        np.concatenate([part.tensor for part in parts]), np.concatenate([part.power for part in parts])
    )


def brightness_off_mean(thumbnails: FrameStack, light: PatternLight, *, scale: float) -> FloatArray:
    """(frame) how much brighter a frame is than the background light, in contrasts: about -1.4 without lamp."""
    share = light.weight * light.inverse / light.weight.sum()
    mean = float((share * light.background).sum())
    return (
        np.concatenate([np.tensordot(values, share, 2) for _, values in frame_blocks(thumbnails, scale=scale)]) - mean
    )


def noise_tensors(
    thumbnails: FrameStack, change_rms: FloatArray, light: PatternLight, *, scale: float, first: int, stop: int
) -> StripeTensors:
    """What noise alone gives, from the quietest pairs of frames among ``first`` … ``stop`` - 1."""
    rms = change_rms[first + 1 : stop]
    quiet = [first + 1 + int(n) for n in np.argsort(np.where(rms > 0, rms, np.inf))[:8]]
    pairs = [np.diff(thumbnails[n - 1 : n + 1].astype(np.float32), axis=0) * np.float32(scale) for n in quiet]
    return stripe_tensors(np.concatenate(pairs) * light.inverse * np.float32(np.sqrt(0.5)), light.weight)


def lit_frames(tensors: FloatArray, brightness: FloatArray, path: FloatArray) -> tuple[int, int]:
    """First and last frame with stripes of half the usual strength or more, and not as dark as without lamp."""
    strength = np.sqrt(np.clip(tensors[:, 0] + tensors[:, 2], 0, None))
    moving = path > 0.3 * path.max()
    usual = float(np.median(strength[moving])) if moving.any() and path.max() > 0 else 0.0
    lit = [run for run in runs((strength > 0.5 * usual) & (brightness > UNLIT)) if run[1] - run[0] >= 2]
    if usual <= 0 or not lit:
        raise no_stripes()
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
        if abs(turned) < 30:
            raise timeline_problem(
                "The stripes stay upright to the end: the lever was never turned. Turn it to its second stop, wait a "
                "second, then crank.",
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
