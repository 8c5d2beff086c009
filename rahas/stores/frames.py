"""Writing frames.zarr while the capture is decoded: memory bounded by one block, whatever the length."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from rahas.stores.arrays import StoreWriter
from rahas.typing import AnyArray

FRAMES_PER_CHUNK = 8
FRAMES_PER_SHARD = 64
LARGEST_BLOCK = 24 << 20
"""bytes of frames in a block; some blocks are held at a time: one is decoded, others are measured and stored"""
LARGEST_WHOLE, LARGEST_BAND = 432_000, 216_000
"""pixels: larger frames than the first (720 x 576 is smaller) are cut into bands of up to the second, a chunk each"""


class GrowingArray:
    """An array whose first axis grows block by block, stored by a second thread."""

    def __init__(self, store: StoreWriter, name: str, dims: tuple[str, ...], **attributes: Any) -> None:
        self._store, self._name, self._dims, self._attributes = store, name, dims, attributes
        self._pool = ThreadPoolExecutor(1)
        self._pending: Future[None] | None = None
        self._array: Any = None
        self.length = 0

    def __enter__(self) -> GrowingArray:
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            if exception[0] is None:
                self.wait()
        finally:
            self._pool.shutdown(wait=True)

    def append(self, block: AnyArray) -> None:
        """Store ``block`` behind what is there; the caller must not change it until the next call returns."""
        self.wait()
        if self._array is None:
            chunk, shard = chunk_and_shard(block.shape[1:], block.dtype)
            shard = min(shard, -(-len(block) // chunk) * chunk)  # blocks that filled a part would be read again
            height, width = block.shape[1:]
            rows, bands = band_rows(height, width)
            self._array = self._store.create(
                self._name,
                self._dims,
                (0, *block.shape[1:]),
                block.dtype,
                chunks=(chunk, rows, width),
                shards=(shard, rows * bands, width),
                **self._attributes,
            )
        start, self.length = self.length, self.length + len(block)
        self._pending = self._pool.submit(self._write, start, block)

    def wait(self) -> None:
        """Return when all is stored; raises what went wrong."""
        if self._pending is not None:
            self._pending.result()
            self._pending = None

    def _write(self, start: int, block: AnyArray) -> None:
        self._array.resize((start + len(block), *block.shape[1:]))
        self._array[start : start + len(block)] = block


def chunk_and_shard(shape: tuple[int, ...], dtype: np.dtype[Any]) -> tuple[int, int]:
    """Frames in a chunk and in a shard, a multiple of it; fewer where frames are large."""
    size = int(np.prod(shape)) * dtype.itemsize
    fitting = max(1, min(FRAMES_PER_SHARD, LARGEST_BLOCK // max(size, 1)))
    chunk = min(FRAMES_PER_CHUNK, fitting)
    return chunk, fitting // chunk * chunk


def band_rows(height: int, width: int) -> tuple[int, int]:
    """Rows of a chunk, an even number where frames are cut at all, and how many such bands make a frame."""
    if height * width <= LARGEST_WHOLE:
        return max(1, height), 1
    bands = -(-height * width // LARGEST_BAND)
    rows = -(-height // (2 * bands)) * 2
    return rows, -(-height // rows)


def in_blocks(frames: Iterable[AnyArray]) -> Iterator[AnyArray]:
    """Gather frames (y, x) into blocks (frame, y, x), each one shard long, in memory of their own."""
    block: AnyArray | None = None
    filled = 0
    for frame in frames:
        if block is None:
            _, size = chunk_and_shard(frame.shape, frame.dtype)
            block = np.empty((size, *frame.shape), frame.dtype.newbyteorder("="))
        block[filled] = frame
        filled += 1
        if filled == len(block):
            yield block
            block, filled = None, 0
    if block is not None:
        yield block[:filled]


class Spool:
    """Blocks put aside on the disk until the whole is known, then read again in order."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by close()
        self._shapes: list[tuple[int, ...]] = []
        self._dtype = np.dtype(np.uint8)

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *exception: object) -> None:
        self._file.close()

    def append(self, block: AnyArray) -> None:
        self._shapes.append(block.shape)
        self._dtype = block.dtype
        self._file.write(np.ascontiguousarray(block).data)

    def __iter__(self) -> Iterator[AnyArray]:
        self._file.seek(0)
        for shape in self._shapes:
            size = int(np.prod(shape)) * self._dtype.itemsize
            yield np.frombuffer(self._file.read(size), self._dtype).reshape(shape)
