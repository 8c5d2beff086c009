"""How long a container says that it is, against how long the file is: bytes cut off or lost within show at once."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

from rahas.stores.matroska import SEGMENT, number_at

_BOXES = {
    b"ftyp",
    b"mdat",
    b"moov",
    b"wide",
    b"free",
    b"skip",
    b"moof",
    b"uuid",
    b"pnot",
    b"sidx",
    b"styp",
    b"mfra",
    b"meta",
}


def missing_bytes(path: Path) -> int:
    """Bytes that MP4/MOV boxes, AVI chunks, a Matroska segment or transport packets promise beyond the end of the file.

    0 where nothing is missing and for containers that promise nothing.
    """
    size = path.stat().st_size
    with open(path, "rb") as handle:
        head = handle.read(192 * 4)
        if head[4:8] in _BOXES:
            return _past_boxes(handle, size)
        if head[:4] == b"RIFF" and head[8:12] == b"AVI ":
            return max(0, int.from_bytes(head[4:8], "little") + 8 - size)
        if head[:4] == b"\x1a\x45\xdf\xa3":
            return _past_segment(head, size)
        return _past_transport_packets(head, size)


def _past_boxes(handle: BinaryIO, size: int) -> int:
    here = 0
    while here + 8 <= size:
        handle.seek(here, os.SEEK_SET)
        head = handle.read(16)
        length = int.from_bytes(head[:4], "big")
        if length == 1:
            length = int.from_bytes(head[8:16], "big")
        if length < 8:  # 0: up to the end of the file
            return 0
        if here + length > size and head[4:8] in _BOXES:
            return here + length - size
        here += length
    return 0


def _past_segment(head: bytes, size: int) -> int:
    here = 0
    while here < len(head) - 16:
        name, name_length = number_at(head, here, marker=True)
        length, length_length = number_at(head, here + name_length, marker=False)
        if name_length == 0 or length is None:
            return 0
        here += name_length + length_length + length
        if name == SEGMENT:
            return max(0, here - size)
    return 0


def _past_transport_packets(head: bytes, size: int) -> int:
    """A transport stream is made of packets of 188 bytes (192 on AVCHD cards); no writer stops within one."""
    for length, offset in ((188, 0), (192, 4)):
        if len(head) > 3 * length and all(head[offset + k * length] == 0x47 for k in range(3)):
            return -size % length
    return 0
