"""Video through PyAV: decoded once, in order, never sought; luma as shot, its times, and all signs of damage.

A picture that the container says to turn for display (a phone held upright) is turned, as the operator saw it.
Audio and further video streams are passed over: the longest video stream counts, the first one of equals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import av.logging
import numpy as np

from rahas.errors import CaptureProblem
from rahas.stores.capture import CaptureFacts, even_times, unreadable
from rahas.stores.container_ends import missing_bytes
from rahas.stores.damage import Frame, Packet, Promise, Witness, findings
from rahas.stores.luma import bit_depth_of, luma_of, upright
from rahas.stores.matroska import damaged_clusters
from rahas.typing import AnyArray, FloatArray

# Only containers of video: playlists and lists of files would read what lies outside the expedition.
CONTAINERS = (
    "matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,avi,mpeg,mpegts,mpegvideo,dv,mxf,flv,asf,ogg,nut,h264,hevc,m4v,mjpeg,ivf,"
    "yuv4mpegpipe,gxf,wtv,rm"
)
_TOP_FIRST, _BOTTOM_FIRST = {2, 5}, {3, 4}  # AVFieldOrder: by the field displayed first
_GIANT = re.compile(r"Picture size (\d+)x(\d+) exceeds specified max pixel count")
_DEAD_ENDS = 100  # errors in a row after which the rest of a file counts as lost
_TIMES_FROM_INDEX = ("avi",)  # containers without presentation times


class Video:
    """A video file being decoded (see :class:`rahas.stores.capture.Capture`)."""

    def __init__(self, path: Path, *, max_pixels: int) -> None:
        self._path = path
        self._max_pixels = max_pixels
        self._witness = Witness()
        self._stamps: list[int | None] = []
        self._flags: dict[str, int] = {}
        self.bit_depth = 8
        self._range = 0
        self._giant = (0, 0)
        """size that the decoder refused"""
        self._facts: CaptureFacts | None = None

    def frames(self) -> Iterator[AnyArray]:
        """Luma of every frame that can be decoded.

        Raises
        ------
        CaptureProblem
            (rule ``unreadable``) No video, a picture too large, or not one frame that can be decoded.
        """
        former = av.logging.get_level()
        av.logging.set_level(av.logging.WARNING)
        av.logging.set_skip_repeated(False)
        try:
            with av.logging.Capture(local=False) as log:
                yield from self._decoded(log)
        finally:
            av.logging.set_level(former)

    def facts(self) -> CaptureFacts:
        if self._facts is None:
            raise RuntimeError("the frames have to be read before the facts are known")
        return self._facts

    def _decoded(self, log: list[tuple[int, str, str]]) -> Iterator[AnyArray]:
        with self._opened(log) as container:
            stream = self._longest(container)
            decoder = stream.codec_context
            names = frozenset({decoder.name, container.format.name})
            self._listen(log, None, names)
            self._refuse_giant(decoder.width, decoder.height)
            if decoder.width == 0:
                self._refuse_giant(*self._giant)
            decoder.options = {"max_pixels": str(self._max_pixels)}
            shape: tuple[int, ...] | None = None
            strangers = 0
            for frame in self._frames_of(container, stream, log, names):
                self._refuse_giant(frame.width, frame.height)
                luma = upright(luma_of(frame), frame.rotation)
                if shape is None:
                    shape, self.bit_depth, self._range = luma.shape, bit_depth_of(frame), int(frame.color_range)
                if luma.shape != shape or bit_depth_of(frame) != self.bit_depth:
                    strangers += 1
                    size = f"{luma.shape[1]} x {luma.shape[0]} pixels of {bit_depth_of(frame)} bit"
                    self._witness.hear(len(self._witness.packets) - 1, 16, decoder.name, f"a frame of {size}", names)
                    continue
                self._witness.frames.append(Frame(frame.pts, bool(frame.key_frame), bool(frame.is_corrupt)))
                self._flags["interlaced"] = self._flags.get("interlaced", 0) + bool(frame.interlaced_frame)
                yield luma
            self._listen(log, None, names)
            if not self._witness.frames:
                self._refuse_giant(*self._giant)
                raise self._nothing_decoded(decoder.name)
            if strangers > len(self._witness.frames):
                raise unreadable(
                    "frame_size",
                    f"The frames of {self._path.name} are not all of one size: {strangers} differ from the first. "
                    "Film a scan in one take with one setting of the camera.",
                    value=strangers,
                )
            self._facts = self._conclude(container, stream)

    def _opened(self, log: list[tuple[int, str, str]]) -> Any:
        options = {
            "format_whitelist": CONTAINERS,
            "protocol_whitelist": "file",
            "max_pixels": str(self._max_pixels),
        }
        try:
            return av.open(str(self._path.absolute()), options=options)
        except (av.FFmpegError, ValueError) as error:
            said = [text.strip() for level, _, text in log if level <= 16]
            if any("moov atom not found" in text for text in said) and self._is_mp4():
                raise unreadable(
                    "container",
                    f"{self._path.name} was cut short: the table of contents at the end of an MP4 file is missing "
                    "(battery or card pulled while filming, or a copy that broke off). Copy it again from the card; "
                    "a repair tool for MP4 files may bring the recording back.",
                ) from None
            raise unreadable("container", f"{self._path.name} is no video: {self._what_it_is(said, error)}") from None

    def _is_mp4(self) -> bool:
        with open(self._path, "rb") as handle:
            return handle.read(12)[4:8] in (b"ftyp", b"mdat", b"wide", b"free", b"skip")

    def _what_it_is(self, said: list[str], error: Exception) -> str:
        with open(self._path, "rb") as handle:
            head = handle.read(4096)
        if head.isascii() and b"\0" not in head:
            start = head[:40].decode().splitlines()[0].strip()
            return f"it holds text ({start!r} …). Put the camera's own file in its place."
        if head[:8] == b"\x89PNG\r\n\x1a\n" or head[:3] == b"\xff\xd8\xff" or head[:4] in (b"II*\0", b"MM\0*"):
            return "it is a single picture. A scan needs the whole film, or a folder with all its pictures."
        reason = next(iter(said), str(error)).rstrip(".")
        return f"no known kind of video was found in it ({reason}). Copy it again from the camera's card."

    def _longest(self, container: Any) -> Any:
        streams = [s for s in container.streams.video if not int(s.disposition) & int(type(s.disposition).attached_pic)]
        if not streams:
            kinds = ", ".join(s.type for s in container.streams) or "nothing"
            raise unreadable(
                "container", f"{self._path.name} holds no video, only: {kinds}. Put the camera's own file in its place."
            )
        return max(streams, key=lambda s: (s.duration or 0) * (s.time_base or Fraction(1)))

    def _frames_of(self, container: Any, stream: Any, log: list[Any], names: frozenset[str]) -> Iterator[Any]:
        """Decode on past every error; note the packets, and what is said while each is worked on."""
        packets, source, dead_ends = self._witness.packets, container.demux(stream), 0
        while dead_ends < _DEAD_ENDS:
            try:
                packet = next(source)
            except StopIteration:
                return
            except (av.FFmpegError, OSError) as error:
                self._witness.hear(
                    len(packets) - 1 if packets else None, 16, stream.codec_context.name, str(error.args[1]), names
                )
                source, dead_ends = container.demux(stream), dead_ends + 1
                continue
            if packet.size:
                position = packet.pos if packet.pos is not None and packet.pos >= 0 else None
                packets.append(
                    Packet(packet.pts, packet.dts, position, bool(packet.is_keyframe), not packet.is_discard)
                )
            here = len(packets) - 1
            try:
                decoded = packet.decode()
            except av.FFmpegError as error:
                decoded = []
                self._witness.hear(here, 16, stream.codec_context.name, str(error.strerror), names)
            dead_ends = 0
            self._listen(log, here, names)
            yield from decoded

    def _listen(self, log: list[tuple[int, str, str]], packet: int | None, names: frozenset[str]) -> None:
        for level, speaker, text in log:
            if match := _GIANT.search(text):
                self._giant = int(match[1]), int(match[2])
            self._witness.hear(packet, level, speaker, text, names)
        log.clear()

    def _refuse_giant(self, width: int, height: int) -> None:
        if width * height > self._max_pixels:
            raise unreadable(
                "frame_size",
                f"{self._path.name} says that its frames have {width} x {height} pixels, more than a scanner's camera "
                "takes: the file is broken, or ingest.max_megapixels in config/config.yaml has to be raised.",
                value=round(width * height / 1e6, 1),
                limit=self._max_pixels / 1e6,
                unit="megapixels",
            )

    def _nothing_decoded(self, codec: str) -> CaptureProblem:
        said = [spoken.text for spoken in self._witness.spoken]
        return unreadable(
            "frames",
            f"Not one frame of {self._path.name} can be decoded ({codec}, {len(self._witness.packets)} packets"
            f"{': ' + said[0] if said else ''}). Copy it again from the camera's card.",
            value=0,
            limit=1,
            unit="frames",
        )

    def _conclude(self, container: Any, stream: Any) -> CaptureFacts:
        witness = self._witness
        witness.bad_ranges = damaged_clusters(self._path)
        witness.missing_bytes = missing_bytes(self._path)
        tick = float(stream.time_base)
        average = float(stream.average_rate or stream.guessed_rate or 30)
        start, times = self._times(container.format.name, tick, average)
        order = int(stream.codec_context.field_order)
        interlaced = 2 * self._flags.get("interlaced", 0) > len(witness.frames)
        default = (
            "bottom_first"
            if stream.codec_context.name == "dvvideo" and stream.codec_context.height == 480
            else "top_first"
        )
        flagged = "top_first" if order in _TOP_FIRST else "bottom_first" if order in _BOTTOM_FIRST else default
        return CaptureFacts(
            time_s=times,
            frame_rate=_rate(times, average),
            codec=stream.codec_context.name,
            bit_depth=self.bit_depth,
            flagged_order=flagged if interlaced else "progressive",
            luma_range={1: "limited", 2: "full"}.get(self._range, "unknown"),
            damage=findings(
                witness,
                _promise(container, stream, start),
                times,
                tick,
                checks_slices=stream.codec_context.name == "ffv1",
            ),
            declared_frames=int(stream.frames) or None,
        )

    def _times(self, container: str, tick: float, rate: float) -> tuple[float, FloatArray]:
        """Start of the first frame on the stream's clock, and the times from it on."""
        stamps = [frame.pts for frame in self._witness.frames]
        if None in stamps or (container in _TIMES_FROM_INDEX and np.any(np.diff(np.array(stamps, np.int64)) <= 0)):
            return 0.0, even_times(len(stamps), rate)
        ticks = np.array(stamps, np.int64)
        return float(ticks[0]) * tick, (ticks - ticks[0]) * tick


def _rate(times: FloatArray, declared: float) -> float:
    """Frames a second: the declared rate where the times agree with it, else what the times give."""
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return declared
    typical, mean = 1.0 / float(np.median(steps)), 1.0 / float(np.mean(steps))
    if abs(declared / typical - 1.0) < 0.05:
        return declared
    return typical if np.mean(np.abs(steps * typical - 1.0) < 0.05) > 0.9 else mean


def _promise(container: Any, stream: Any, start_s: float) -> Promise:
    """What the container's header says of the stream's length, told independently of the packets themselves."""
    kind = container.format.name
    if kind.startswith("matroska"):
        tag = stream.metadata.get("DURATION") or stream.metadata.get("DURATION-eng")
        if tag:
            return Promise(_seconds_of(tag) - start_s)
        alone = len(container.streams) == 1 and container.duration
        return Promise(container.duration / av.time_base - start_s if alone else None)
    if kind in ("avi", "flv", "asf", "nut", "mxf") and stream.duration:
        return Promise(float(stream.duration * stream.time_base))
    return Promise(None)


def _seconds_of(tag: str) -> float:
    try:
        hours, minutes, seconds = tag.split(":")
        return 3600 * int(hours) + 60 * int(minutes) + float(seconds)
    except ValueError:
        return 0.0
