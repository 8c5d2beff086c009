"""Frames of a capture as single moments: one field of an interlaced frame, brought to square pixels, binned."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from rahas.stages.ahead import ahead
from rahas.typing import AnyArray, FrameStack

_BLOCK = 8


class Moments:
    """Reads a stack in aligned blocks; every frame comes as one moment, ``factor`` times smaller than the image.

    A length of one pixel here is ``factor`` pixels of the image, along x and along y, interlaced or not.
    """

    def __init__(self, frames: FrameStack, *, interlaced: bool, top_first: bool, factor: int) -> None:
        self._frames = frames
        self.factor = factor
        self._rows = slice(0 if top_first else 1, None, 2) if interlaced else slice(None)
        field_height = len(range(*self._rows.indices(frames.shape[1])))
        self._down = factor if not interlaced else factor / 2
        self.shape = (int(field_height // self._down), frames.shape[2] // factor)
        self._cut = (int(self.shape[0] * self._down), self.shape[1] * factor)

    def blocks(self, first: int, last: int) -> Iterator[tuple[int, AnyArray]]:
        """(number of the first, binned frames (frame, y, x) float32 or as shot) from ``first`` to ``last``, both in."""
        for start, raw in self._raw_blocks(first, last):
            yield start, np.stack([self._binned(frame) for frame in raw])

    def samples(self, numbers: list[int]) -> AnyArray:
        """Single pixels of frames (sample, y, x), as shot, one for each binned pixel: their noise is a pixel's own."""
        step_y = max(int(self._down), 1)
        picked = [np.asarray(self._frames[n : n + 1])[0][self._rows][::step_y, :: self.factor] for n in numbers]
        if not picked:
            return np.zeros((0, *self.shape), self._frames.dtype)
        return np.stack([self._fitted(frame) for frame in picked])

    def _fitted(self, frame: AnyArray) -> AnyArray:
        frame = frame[: self.shape[0], : self.shape[1]]
        if frame.shape == self.shape:
            return frame
        return np.asarray(cv2.resize(frame, self.shape[::-1], interpolation=cv2.INTER_NEAREST))

    def _raw_blocks(self, first: int, last: int) -> Iterator[tuple[int, AnyArray]]:
        starts = [first, *range((first // _BLOCK + 1) * _BLOCK, last + 1, _BLOCK)]
        yield from ahead(lambda n: (n, np.asarray(self._frames[n : min((n // _BLOCK + 1) * _BLOCK, last + 1)])), starts)

    def _binned(self, frame: AnyArray) -> AnyArray:
        field = frame[self._rows][: self._cut[0], : self._cut[1]]
        if field.shape == self.shape:
            return field
        smaller: Any = cv2.resize(np.ascontiguousarray(field), self.shape[::-1], interpolation=cv2.INTER_AREA)
        return np.asarray(smaller)
