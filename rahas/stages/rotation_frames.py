"""What the rotation code takes from a capture: some frames of the rotation, and Φ0 from the first hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rahas.kernels.first_hold_phase import EXPONENTS, first_phase_of_hold, polynomial_terms
from rahas.kernels.rotation_model import SIGNAL_LIMIT, TURN, RotationPixels
from rahas.stages.frame_bands import bands_of, pixels_at
from rahas.typing import AnyArray, BoolArray, FloatArray, FrameStack

BLOCK = 8
HOLD_FRAMES = 8
ROTATION_FRAMES = 64
FEWEST_FRAMES = 16
KEPT_BYTES = 32_000_000
"""Of rotation frames kept in memory; those of larger images are read again, band by band."""


class Rotation(NamedTuple):
    """What the timeline knows of the slide's turn."""

    first: int
    last: int
    """Frames of the rotation, both inclusive."""
    first_hold: tuple[int, int]
    """First and last frame of the hold before it."""
    slide_angle_deg: FloatArray
    """(frame) 0 at the first stop, 90 at the second, NaN in the dark; 2° off is good enough."""
    sense: int
    """+1: Φ0 grows with x; −1: it falls."""


class Scanned(NamedTuple):
    """What the scan knows of each pixel, (y, x)."""

    wrapped_phase: AnyArray
    """Radians, at the reference slide position; a rough one (0.3 rad off) will do."""
    background: AnyArray
    """a, grey levels."""
    modulation: AnyArray
    """b, grey levels."""
    measured: BoolArray
    """Where an order is wanted: b above 0, φ finite."""

    def pixels(self, levels: AnyArray, at: tuple[AnyArray, AnyArray]) -> RotationPixels:
        """Pixels at rows and columns ``at``, with their rotation ``levels`` (frame, pixel)."""
        return RotationPixels(levels, self.background[at], self.modulation[at], self.wrapped_phase[at] / TURN)


def rotation_of_timeline(timeline: Mapping[str, Any]) -> Rotation:
    """From the content of timeline.json, whose capture has a rotation; without a hold before it, its first frame."""
    spans = [(str(i["stage"]), int(i["first"]), int(i["last"])) for i in timeline["intervals"]]
    at = next(n for n, span in enumerate(spans) if span[0] == "rotation")
    _, first, last = spans[at]
    held = at > 0 and spans[at - 1][0] == "hold"
    angle = np.array([np.nan if a is None else a for a in timeline["slide_angle_deg"]], dtype=np.float64)
    return Rotation(first, last, spans[at - 1][1:] if held else (first, first), angle, int(timeline["rotation_sense"]))


def chosen_frames(frames: FrameStack, rotation: Rotation) -> AnyArray:
    """Numbers of at most ``ROTATION_FRAMES`` frames of the rotation, evenly in angle."""
    numbers = np.arange(rotation.first, rotation.last + 1)
    numbers = numbers[np.isfinite(rotation.slide_angle_deg[numbers])]
    if not len(numbers):
        return numbers
    angle = rotation.slide_angle_deg[numbers]
    wanted = np.linspace(angle.min(), angle.max(), ROTATION_FRAMES)
    return numbers[np.unique(np.abs(angle[:, None] - wanted).argmin(axis=0))]


class Shots:
    """Some frames of a capture: kept in memory where they are small, else read where they are asked for."""

    def __init__(self, frames: FrameStack, numbers: AnyArray) -> None:
        self._frames = frames
        self.numbers = numbers
        self._kept: AnyArray | None = None
        if len(numbers) * frames.shape[1] * frames.shape[2] * frames.dtype.itemsize <= KEPT_BYTES:
            self._kept = self._read(slice(0, frames.shape[1]))

    def rows(self, span: slice) -> AnyArray:
        """Rows (a slice with start and stop) of all the frames, (frame, y, x) as shot."""
        return self._read(span) if self._kept is None else self._kept[:, span]

    def bands(self) -> list[slice]:
        """Rows to be asked for at a time."""
        return bands_of(self._frames)

    def pixels(self, rows: AnyArray, columns: AnyArray) -> AnyArray:
        """Grey levels (frame, pixel)."""
        return pixels_at(lambda band: iter([self.rows(band)]), self.bands(), rows, columns)

    def _read(self, span: slice) -> AnyArray:
        out = np.empty((len(self.numbers), span.stop - span.start, self._frames.shape[2]), self._frames.dtype)
        for block in np.unique(self.numbers // BLOCK):
            inside = np.flatnonzero(self.numbers // BLOCK == block)
            first, last = self.numbers[inside[0]], self.numbers[inside[-1]]
            out[inside] = np.asarray(self._frames[first : last + 1, span])[self.numbers[inside] - first]
        return out


def first_phase_of_frames(frames: FrameStack, rotation: Rotation, rows: slice, scanned: Scanned) -> FloatArray:
    """Φ0 (term) over the whole image in turns, its integer arbitrary, from the ``rows`` of the first field.

    Raises
    ------
    ValueError
        The hold shows no stripes that run down the image.
    """
    hold = rotation.first_hold
    last = max(hold[0], hold[1] - 1)  # the lever may be moving already in the last frame
    level = np.asarray(frames[max(hold[0], last - HOLD_FRAMES + 1) : last + 1])[:, rows].mean(axis=0, dtype=np.float32)
    measured, background = scanned.measured[rows], scanned.background[rows]
    gain = level[measured].mean() / background[measured].mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        level /= gain
        level -= background
        level /= scanned.modulation[rows]
    np.clip(level, -SIGNAL_LIMIT, SIGNAL_LIMIT, out=level)
    level[~measured] = 0.0
    own = first_phase_of_hold(level, sense=rotation.sense)
    height = frames.shape[1]
    return own if len(measured) == height else _on_whole_image(own, rows, height)


def _on_whole_image(coefficients: FloatArray, rows: slice, height: int) -> FloatArray:
    """A field's polynomial as one of the whole image: ŷ of the field is linear in ŷ of the image."""
    own = np.arange(height)[rows]
    grid_y, grid_x = np.mgrid[0 : len(own) : 12j, 0:100:12j]
    terms = polynomial_terms(grid_y, grid_x, (len(own), 101)).reshape(len(EXPONENTS), -1)
    whole = polynomial_terms(own[0] + 2.0 * grid_y, grid_x, (height, 101)).reshape(len(EXPONENTS), -1)
    return np.asarray(np.linalg.lstsq(whole.T, terms.T @ coefficients, rcond=None)[0])
