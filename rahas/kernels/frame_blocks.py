"""Reading a stack of frames block by block, so that memory stays bounded however long the capture is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rahas.typing import Float32Array, FrameStack

BLOCK_FRAMES = 128
BLOCK_PIXELS = 2_800_000
"""Of all frames of a block: large frames come in shorter blocks."""


def frame_blocks(
    stack: FrameStack, *, first: int = 0, stop: int | None = None, scale: float = 1.0
) -> Iterator[tuple[slice, Float32Array]]:
    """Yield (frames, values): a slice of frame numbers and those frames as float32 times ``scale``, (frame, y, x)."""
    stop = stack.shape[0] if stop is None else stop
    fitting = BLOCK_PIXELS // max(1, stack.shape[1] * stack.shape[2])
    size = min(BLOCK_FRAMES, max(8, fitting // 8 * 8))  # stores keep eight frames in a chunk
    for start in range(first, stop, size):
        frames = slice(start, min(start + size, stop))
        yield frames, np.multiply(stack[frames], np.float32(scale), dtype=np.float32)
