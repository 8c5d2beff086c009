"""Frames into a video file or a folder of PNGs: luma as given, the same bytes for the same frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from rahas.stores.atomic import replacing
from rahas.typing import ByteArray

CODECS = {"ffv1": "ffv1", "h264": "libx264", "mpeg2": "mpeg2video", "mjpeg": "mjpeg"}
SUFFIXES = {"ffv1": ".mkv", "h264": ".mp4", "mpeg2": ".mpg", "mjpeg": ".avi", "png": ""}
FieldOrder = Literal["progressive", "top_first", "bottom_first"]

_LAMBDA = 118  # of the codecs' quantiser scale
_LIMITED, _FULL = 1, 2


class Encoding(NamedTuple):
    """How frames are stored."""

    codec: str
    """ffv1 (lossless), h264, mpeg2, mjpeg, or png: a folder of pictures."""
    frame_rate: float = 30.0
    fields: FieldOrder = "progressive"
    full_range: bool = False
    """What the file says of its luma (MJPEG is always full); the codes are stored as they are."""
    crf: float = 12.0
    quantiser: int = 2


def write_frames(path: Path, frames: Iterable[ByteArray], encoding: Encoding) -> int:
    """Write frames (y, x) uint8 of even width and height to ``path`` atomically; returns their number.

    Single-threaded and without dates or random identifiers: equal frames give equal files.

    Raises
    ------
    ValueError
        No frames, an odd size, or fields asked of a codec that has none (FFV1, H.264 and MPEG-2 have).
    """
    if encoding.fields != "progressive" and encoding.codec not in ("ffv1", "h264", "mpeg2"):
        raise ValueError(f"{encoding.codec} cannot be written as {encoding.fields}; ffv1, h264 and mpeg2 can")
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise ValueError(f"{path.name}: there are no frames to write")
    with replacing(path) as temporary:
        write = _write_pictures if encoding.codec == "png" else _write_video
        return write(temporary, _chained(first, iterator), first.shape, encoding)


def _chained(first: ByteArray, rest: Iterator[ByteArray]) -> Iterator[ByteArray]:
    yield first
    yield from rest


def _write_pictures(folder: Path, frames: Iterator[ByteArray], shape: tuple[int, ...], encoding: Encoding) -> int:
    import cv2

    folder.mkdir()
    count = 0
    for frame in frames:
        if not cv2.imwrite(str(folder / f"frame_{count:05d}.png"), frame, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
            raise OSError(f"{folder / f'frame_{count:05d}.png'} could not be written")
        count += 1
    return count


def _write_video(path: Path, frames: Iterator[ByteArray], shape: tuple[int, ...], encoding: Encoding) -> int:
    import av

    height, width = shape
    if height % 2 or width % 2:
        raise ValueError(f"{width} × {height}: a video's width and height are even")
    rate = Fraction(encoding.frame_rate).limit_denominator(1001)
    range_code = _FULL if encoding.full_range or encoding.codec == "mjpeg" else _LIMITED
    pixel_format = "yuvj420p" if encoding.codec == "mjpeg" else "yuv420p"
    with av.open(str(path), "w", options={"fflags": "+bitexact"}) as container:
        stream: Any = container.add_stream(CODECS[encoding.codec], rate=rate, options=_options(encoding))
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        context = stream.codec_context
        context.thread_count, context.color_range = 1, range_code
        if encoding.codec == "mpeg2":
            context.gop_size = 12
        flagged = _field_flags(width, height, pixel_format, rate, encoding.fields)
        count = 0
        grey = np.uint8(128)
        for frame in frames:
            picture = av.VideoFrame(width, height, pixel_format)
            for plane, content in zip(picture.planes, (frame, grey, grey), strict=True):
                rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
                rows[:, : plane.width] = content
            picture.time_base, picture.color_range, picture.pts = 1 / rate, range_code, count
            for packet in stream.encode(flagged(picture)):
                container.mux(packet)
            count += 1
        for packet in stream.encode(None):
            container.mux(packet)
    return count


def _options(encoding: Encoding) -> dict[str, str]:
    interlaced = "+ildct+ilme" if encoding.fields != "progressive" else ""
    if encoding.codec == "ffv1":
        return {"level": "3", "slices": "4", "slicecrc": "1", "flags": "+bitexact"}
    if encoding.codec == "h264":
        order = {"progressive": {}, "top_first": {"x264-params": "tff=1"}, "bottom_first": {"x264-params": "bff=1"}}
        settings = {"crf": str(encoding.crf), "preset": "veryfast", "flags": "+bitexact" + interlaced}
        return settings | order[encoding.fields]
    return {"flags": "+bitexact+qscale" + interlaced, "global_quality": str(encoding.quantiser * _LAMBDA)}


def _field_flags(width: int, height: int, pixel_format: str, rate: Fraction, fields: FieldOrder) -> Any:
    """A function that marks a frame as interlaced with its first field; the codec writes what the frame says."""
    if fields == "progressive":
        return lambda picture: picture
    import av
    from av.filter import Graph

    graph = Graph()
    layout = av.VideoFormat(pixel_format, width, height)
    source = graph.add_buffer(width=width, height=height, format=layout, time_base=1 / rate)
    marker = graph.add("setfield", "mode=tff" if fields == "top_first" else "mode=bff")
    sink = graph.add("buffersink")
    source.link_to(marker)
    marker.link_to(sink)
    graph.configure()

    def flagged(picture: Any) -> Any:
        graph.push(picture)
        return graph.pull()

    return flagged
