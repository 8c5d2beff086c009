"""Frames read by bands of rows, so that memory stays bounded however large they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rahas.stages.ahead import ahead
from rahas.typing import AnyArray, FrameStack

WHOLE_PIXELS, BAND_PIXELS = 432_000, 216_000
"""Larger frames than the first (720 × 576 is smaller) are read in bands of up to the second."""
BLOCK = 16  # frames


class FieldFrames(NamedTuple):
    """The frames ``first`` … ``end`` - 1 of one field: ``rows`` of the image, a slice."""

    frames: FrameStack
    first: int
    end: int
    rows: slice

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the field."""
        return len(self._image_rows), self.frames.shape[2]

    def bands(self) -> list[slice]:
        """Rows of the field, band by band."""
        return bands_of(self.frames, self.rows)

    def blocks(self, band: slice = slice(None)) -> Iterator[AnyArray]:
        """Some rows of the field, in blocks (n, y, x) of frames."""
        rows = self._image_rows[band]
        span = slice(rows[0], rows[-1] + 1)

        def read(start: int) -> AnyArray:
            return np.asarray(self.frames[start : min(start + BLOCK, self.end), span])[:, :: rows.step]

        return ahead(read, range(self.first, self.end, BLOCK), depth=1)

    def at(self, rows: AnyArray, columns: AnyArray) -> AnyArray:
        """Grey levels (frame, pixel) of single pixels of the field."""
        return pixels_at(self.blocks, self.bands(), rows, columns)

    @property
    def _image_rows(self) -> range:
        return range(*self.rows.indices(self.frames.shape[1]))


def pixels_at(
    blocks: Callable[[slice], Iterator[AnyArray]], bands: Sequence[slice], rows: AnyArray, columns: AnyArray
) -> AnyArray:
    """Grey levels (frame, pixel) at ``rows`` and ``columns`` of what ``blocks`` gives for each band."""
    band_of = np.searchsorted([band.stop for band in bands], rows, side="right")
    parts, places = [], []
    for number in np.unique(band_of):
        inside = np.flatnonzero(band_of == number)
        at = rows[inside] - bands[number].start, columns[inside]
        parts.append(np.concatenate([block[:, at[0], at[1]] for block in blocks(bands[number])]))
        places.append(inside)
    return np.concatenate(parts, axis=1)[:, np.argsort(np.concatenate(places))]


def bands_of(frames: FrameStack, rows: slice = slice(None)) -> list[slice]:
    """Runs of a field's rows of at most ``BAND_PIXELS``, along the borders of a store's chunks where they allow it."""
    height, width = frames.shape[1:]
    if height * width <= WHOLE_PIXELS:
        return [slice(0, len(range(*rows.indices(height))))]
    image_rows = range(*rows.indices(height))
    fitting = max(1, BAND_PIXELS // width * image_rows.step)  # rows of the image
    chunk = getattr(frames, "chunks", (1, 1, 1))[1]
    size = fitting // chunk * chunk if chunk <= fitting else fitting
    borders = np.searchsorted(np.array(image_rows), np.arange(0, height + size, size))
    return [slice(int(a), int(b)) for a, b in pairwise(borders) if b > a]
