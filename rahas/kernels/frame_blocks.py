"""Reading a stack of frames block by block, so that memory stays bounded however long the capture is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rahas.typing import Float32Array, FrameStack

BLOCK_FRAMES = 128


def frame_blocks(
    stack: FrameStack, *, first: int = 0, stop: int | None = None, scale: float = 1.0
) -> Iterator[tuple[slice, Float32Array]]:
    """Yield (frames, values): a slice of frame numbers and those frames as float32 times ``scale``, (frame, y, x)."""
    stop = stack.shape[0] if stop is None else stop
    for start in range(first, stop, BLOCK_FRAMES):
        frames = slice(start, min(start + BLOCK_FRAMES, stop))
        yield frames, np.multiply(stack[frames], np.float32(scale), dtype=np.float32)
