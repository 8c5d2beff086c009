"""One capture from its specification: frames, texture photo and truth, in memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rahas.simulate.frames import filmed_frames, render_frames
from rahas.simulate.hand import Motion, motion_of
from rahas.simulate.maps import Maps, maps_of, photo_of, surface_of
from rahas.simulate.specs import CaptureSpec
from rahas.simulate.surface import Surface
from rahas.simulate.truth import field_centre, truth_of
from rahas.typing import AnyArray, ByteArray, IntArray


class Staged(NamedTuple):
    """A capture set up, before the camera runs."""

    capture: CaptureSpec
    surface: Surface
    maps: Maps
    motion: Motion
    shows: IntArray
    """(frame,): number, as shot, of what each frame shows."""

    def frames(self) -> Iterator[ByteArray]:
        """The film, frame by frame (y, x)."""
        c = self.capture
        return render_frames(self.maps, c.rig, self.motion, c.camera, shows=self.shows, seed=c.seed)

    def truth(self) -> dict[str, AnyArray]:
        """What the frames really show."""
        return truth_of(self.capture, self.maps, self.motion, self.shows)


class Rendering(NamedTuple):
    """A rendered capture."""

    frames: ByteArray
    """(frame, y, x)"""
    truth: dict[str, AnyArray]


def stage(capture: CaptureSpec) -> Staged:
    """Build the scene, trace the maps and plan the motion."""
    surface = surface_of(capture)
    maps = maps_of(capture, surface)
    motion = motion_of(capture.hand, capture.rig, centre_v=field_centre(maps)[1], seed=capture.seed)
    return Staged(capture, surface, maps, motion, filmed_frames(capture.camera, capture.hand.duration_s))


def render(capture: CaptureSpec) -> Rendering:
    """Render a capture without files: frames (frame, y, x) uint8 and truth."""
    staged = stage(capture)
    frames = np.empty((len(staged.shows), capture.rig.height_px, capture.rig.width_px), np.uint8)
    for n, frame in enumerate(staged.frames()):
        frames[n] = frame
    return Rendering(frames, staged.truth())


def photo(staged: Staged) -> ByteArray:
    """The texture camera's photo (y, x, 3), red, green, blue, gamma 2.2, a little noise."""
    picture = photo_of(staged.capture, staged.surface)
    noise = np.random.Generator(np.random.SFC64([staged.capture.seed, 7])).standard_normal(picture.shape, np.float32)
    picture += noise * np.float32(0.003)
    table = np.rint(255 * (np.arange(4096) / 4095) ** (1 / 2.2)).astype(np.uint8)
    return table[np.clip(picture * 4095, 0, 4095).astype(np.uint16)]
