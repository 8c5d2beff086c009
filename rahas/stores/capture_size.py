"""How large a capture is, from its header or its frame store, without decoding a frame: enough to plan resources."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from rahas.stores.captures import PICTURE_SUFFIXES

LEAST_BYTES_PER_PIXEL = 0.02
"""of a film; the most compressed capture of the embedded expedition (MJPEG, mostly dark) has that"""


class CaptureSize(NamedTuple):
    """What memory and time of a scan's jobs depend on."""

    frames: int
    pixels: int
    """of a frame"""
    bytes_per_sample: int = 1

    @property
    def megabytes(self) -> float:
        """One frame's luma, 10⁶ bytes."""
        return self.pixels * self.bytes_per_sample / 1e6

    @property
    def total_megapixels(self) -> float:
        """All frames' pixels, 10⁶."""
        return self.frames * self.pixels / 1e6


def size_of_store(frames: Path) -> CaptureSize | None:
    """Of a frame store, from the description of its array; ``None`` where there is none."""
    try:
        described = json.loads((frames / "frames" / "zarr.json").read_text(encoding="utf-8"))
        count, height, width = map(int, described["shape"])
        return CaptureSize(count, height * width, 1 if described["data_type"] == "uint8" else 2)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def size_of_capture(path: Path | None, *, max_pixels: int) -> CaptureSize | None:
    """Of a video or a folder of stills, from its header; ``None`` where that tells nothing that can be believed."""
    if path is None or not path.exists():
        return None
    try:
        size = _of_folder(path) if path.is_dir() else _of_video(path, max_pixels)
    except Exception:  # a broken capture is the job's to judge, in words; here it is of unknown size
        return None
    return size if size is not None and 0 < size.pixels <= max_pixels and size.frames > 0 else None


def _of_video(path: Path, max_pixels: int) -> CaptureSize:
    import av  # a quarter of a second, and only where sizes are asked for

    from rahas.stores.video import CONTAINERS

    options = {"format_whitelist": CONTAINERS, "protocol_whitelist": "file", "max_pixels": str(max_pixels)}
    with av.open(str(path.absolute()), options=options) as container:
        stream = max(container.streams.video, key=lambda s: s.width * s.height)
        pixels = stream.width * stream.height
        frames = stream.frames
        if not frames and stream.average_rate:
            if stream.duration and stream.time_base:
                frames = round(stream.duration * stream.time_base * stream.average_rate)
            elif container.duration:
                frames = round(container.duration / av.time_base * stream.average_rate)
        deep = stream.format is not None and max((c.bits for c in stream.format.components), default=8) > 8
    if frames <= 0:
        frames = round(path.stat().st_size / (LEAST_BYTES_PER_PIXEL * pixels))
    return CaptureSize(int(frames), int(pixels), 2 if deep else 1)


def _of_folder(path: Path) -> CaptureSize:
    from PIL import Image

    files = sorted(p for p in path.iterdir() if p.suffix.lower() in PICTURE_SUFFIXES and not p.name.startswith("."))
    with Image.open(files[0]) as picture:  # reads the header alone
        return CaptureSize(len(files), picture.width * picture.height, 2 if picture.mode.startswith("I") else 1)
