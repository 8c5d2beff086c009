"""Checksums of a Matroska file: writers such as FFmpeg put a CRC-32 before every cluster, which no decoder looks at."""

from __future__ import annotations

import mmap
import zlib
from pathlib import Path
from typing import NamedTuple

_PIECE = 4 << 20  # bytes
_EBML, SEGMENT, _CLUSTER, _CRC32 = 0x1A45DFA3, 0x18538067, 0x1F43B675, b"\xbf\x84"


class ByteRange(NamedTuple):
    """Bytes ``start`` to ``stop`` (excluded) of a file."""

    start: int
    stop: int


def damaged_clusters(path: Path) -> list[ByteRange]:
    """Clusters whose checksum does not fit; empty for other files and where the writer put no checksums."""
    if path.stat().st_size < 64:
        return []
    with open(path, "rb") as handle, mmap.mmap(handle.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[:4] != _EBML.to_bytes(4, "big"):
            return []
        return _walk(data)


def _walk(data: mmap.mmap) -> list[ByteRange]:
    damaged: list[ByteRange] = []
    here, end = 0, len(data)
    while here < end - 12:
        name, name_length = number_at(data, here, marker=True)
        size, size_length = number_at(data, here + name_length, marker=False)
        body = here + name_length + size_length
        if name == SEGMENT:
            here = body
            continue
        if name_length == 0 or size_length == 0 or size is None or body + size > end:
            lost = data.find(_CLUSTER.to_bytes(4, "big"), here + 1)  # past a broken element: the next cluster
            if lost < 0:
                break
            here = lost
            continue
        if name == _CLUSTER and data[body : body + 2] == _CRC32:
            expected = int.from_bytes(data[body + 2 : body + 6], "little")
            if _checksum(data, body + 6, body + size) != expected:
                damaged.append(ByteRange(here, body + size))
        here = body + size
    return damaged


def _checksum(data: mmap.mmap, start: int, stop: int) -> int:
    """CRC-32 of a range; pages looked at are given back, or the whole file would count as memory of this process."""
    value = 0
    for here in range(start, stop, _PIECE):
        with memoryview(data) as view, view[here : min(here + _PIECE, stop)] as piece:
            value = zlib.crc32(piece, value)
        if hasattr(mmap, "MADV_DONTNEED"):
            first = here // mmap.PAGESIZE * mmap.PAGESIZE
            data.madvise(mmap.MADV_DONTNEED, first, min(here + _PIECE, stop) - first)
    return value


def number_at(data: mmap.mmap | bytes, at: int, *, marker: bool) -> tuple[int | None, int]:
    """An EBML number and its length in bytes; (None, length) for an unknown size, (None, 0) for none at all."""
    first = data[at] if at < len(data) else 0
    length = 9 - first.bit_length()
    if first == 0 or length > 8:
        return None, 0
    value = int.from_bytes(data[at : at + length], "big")
    bare = value & ((1 << (7 * length)) - 1)
    if bare == (1 << (7 * length)) - 1:
        return None, length
    return (value if marker else bare), length
