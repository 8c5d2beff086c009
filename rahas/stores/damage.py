"""Damage of a video: what the decoder said, what the container promised, and which stored frames it concerns.

Decoders conceal damage, so no single witness is enough. Heard are: messages of the video decoder and of the container
reader, frames marked corrupt, checksums (FFV1 slices, Matroska clusters), packets that gave no frame, the declared
length of the file, gaps and order of the presentation times. What none of them can see is a flipped bit that leaves a
valid stream, in formats without checksums: of single flips a third to a half in H.264, MPEG-2 and MPEG-4 and most in
MJPEG, HEVC, VP9 or raw video outside Matroska; of tens of flips hardly any but in HEVC, VP9 and raw video.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rahas.typing import FloatArray

LOST_IN_A_ROW = 3
"""Fewer frames missing from even times are the camera's dropped frames: a matter of the timeline, not damage."""

_ERROR, _WARNING = 16, 24  # levels of FFmpeg's log, the graver the lower
_GRAVE_WARNINGS = re.compile(
    r"Packet corrupt|EOI missing|Skipping invalid undecodable NALU|Continuity check failed|Invalid timestamps"
    r"|DTS discontinuity"
)
_HARMLESS = re.compile(
    r"co located POCs unavailable|mmco: unref short failure|number of reference frames .* exceeds max|reorder buffer"
    r"|Could not find codec parameters|at \d+\.\d+ seconds"
)
_CUT_SHORT = re.compile(r"File ended prematurely|partial file|moov atom not found")
_DTS = re.compile(r"dts = (-?\d+)")
_POSITION = re.compile(r"(?:at pos|Element at) (?:(\d+) \(|0x([0-9a-f]+))")
_MESSAGES_KEPT = 2000


class Packet(NamedTuple):
    """A packet of the video stream, in the order of the file."""

    pts: int | None
    dts: int | None
    position: int | None
    key: bool
    shown: bool
    """not cut away by an edit list"""


class Frame(NamedTuple):
    """A decoded and stored frame, in the order of presentation."""

    pts: int | None
    key: bool
    corrupt: bool


class Spoken(NamedTuple):
    """A message of the decoder or of the container reader, heard while packet number ``packet`` was worked on."""

    packet: int | None
    text: str


@dataclass
class Witness:
    """All that was seen of a video while it was decoded once, in order."""

    packets: list[Packet] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    spoken: list[Spoken] = field(default_factory=list)
    bad_ranges: Sequence[tuple[int, int]] = ()
    """byte ranges whose checksum does not fit"""
    missing_bytes: int = 0
    """bytes that the container promises beyond the end of the file"""

    def hear(self, packet: int | None, level: int, speaker: str, text: str, names: frozenset[str]) -> None:
        """Keep a log message if it is about the video stream and tells of damage."""
        grave = level <= _ERROR or bool(_GRAVE_WARNINGS.search(text))
        if grave and speaker in names and not _HARMLESS.search(text) and len(self.spoken) < _MESSAGES_KEPT:
            self.spoken.append(Spoken(packet, " ".join(text.split())))


class Promise(NamedTuple):
    """What the container says of the video stream; None where it says nothing that can be relied on."""

    end_s: float | None
    """presentation time at which the last frame ends"""


def findings(
    witness: Witness, promise: Promise, times_s: FloatArray, tick_s: float, *, checks_slices: bool
) -> list[dict[str, Any]]:
    """The damage of a video: [{``kind``, ``frame``, ``last_frame``, ``message``}], frames 0-based, both inclusive.

    ``frame`` is None where the place is not known. ``checks_slices``: the decoder verifies every byte by itself, so
    that its own messages tell the place better than the container's checksum does.
    """
    places = _Places(witness, len(times_s))
    found: list[dict[str, Any]] = []
    said: dict[tuple[int | None, int | None], list[str]] = defaultdict(list)
    cut_short: list[str] = []
    first_key = next((n for n, packet in enumerate(witness.packets) if packet.key), 0)
    for spoken in witness.spoken:
        if _CUT_SHORT.search(spoken.text):
            cut_short.append(spoken.text)
        elif spoken.packet is None or spoken.packet >= first_key or _DTS.search(spoken.text):
            said[places.of(spoken)].append(spoken.text)
    first_key_frame = next((n for n, frame in enumerate(witness.frames) if frame.key), 0)
    for n, frame in enumerate(witness.frames):
        if frame.corrupt and n >= first_key_frame:
            said[(n, n)].append("the decoder marks the frame as corrupt")
    spoken_of = [(a, b) for a, b in said if a is not None and b is not None]
    for start, stop in witness.bad_ranges:
        span = places.of_bytes(start, stop)
        inside = (
            span[0] is not None and span[1] is not None and any(span[0] <= a and b <= span[1] for a, b in spoken_of)
        )
        if not (checks_slices and inside):
            said[span].append("the checksum of this part of the file does not fit")
    found += [_entry("decoder_message", a, b, _told(texts)) for (a, b), texts in _merged(said)]
    found += _holes(witness, times_s, tick_s)
    missing, last = _missing_end(promise, times_s), len(times_s) - 1
    if missing:
        found.append(
            _entry("truncated", last, last, f"The file was cut short: about {missing} frames are missing at its end.")
        )
    elif witness.missing_bytes or cut_short:
        lost = f"{witness.missing_bytes} bytes are missing" if witness.missing_bytes else "its end is missing"
        place = last if cut_short or not found else None
        found.append(
            _entry("truncated", place, place, f"The file is shorter than it says: {lost}." + _quoted(cut_short))
        )
    placed = [entry for entry in found if entry["frame"] is not None]
    return sorted(placed, key=lambda entry: entry["frame"]) or found


class _Places:
    """From packets, time stamps and bytes to the frames that were stored."""

    def __init__(self, witness: Witness, count: int) -> None:
        self.packets, self.frames, self.count = witness.packets, witness.frames, count
        stamps = [frame.pts for frame in witness.frames]
        self.stamps = np.array(stamps, np.int64) if stamps and None not in stamps else None
        self.keys = [n for n, frame in enumerate(witness.frames) if frame.key]
        self.key_packets = [n for n, packet in enumerate(witness.packets) if packet.key]

    def of(self, spoken: Spoken) -> tuple[int | None, int | None]:
        number = spoken.packet
        if match := _DTS.search(spoken.text):
            number = next((n for n, p in enumerate(self.packets) if p.dts == int(match[1])), number)
        elif number is None and (match := _POSITION.search(spoken.text)):
            position = int(match[1]) if match[1] else int(match[2], 16)
            behind = (n for n, p in enumerate(self.packets) if p.position is not None and p.position >= position)
            number = max(0, next(behind, len(self.packets)) - 1)
        return (None, None) if number is None else self.of_packets(number, number)

    def of_bytes(self, start: int, stop: int) -> tuple[int | None, int | None]:
        inside = [n for n, p in enumerate(self.packets) if p.position is not None and start <= p.position < stop]
        return self.of_packets(inside[0], inside[-1]) if inside else (None, None)

    def of_packets(self, first: int, last: int) -> tuple[int, int]:
        """Frames that packets first … last touch: their own and all that are predicted from them, up to a key frame."""
        stop = next((n for n in self.key_packets if n > last), len(self.packets))
        if self.stamps is None:
            start = min(first, self.count - 1)
            end = min(max(stop - 1, last), self.count - 1)
        else:
            stamps = [p.pts for p in self.packets[first:stop] if p.pts is not None and p.shown]
            start = self._frame_at(min(stamps)) if stamps else min(first, self.count - 1)
            end = self._frame_at(max(stamps)) if stamps else start
        end = max(end, next((n for n in self.keys if n > end), self.count) - 1) if end not in self.keys else end
        return start, max(start, end)

    def _frame_at(self, pts: int) -> int:
        assert self.stamps is not None
        return int(min(np.searchsorted(np.maximum.accumulate(self.stamps), pts), self.count - 1))


def _merged(
    said: dict[tuple[int | None, int | None], list[str]],
) -> list[tuple[tuple[int | None, int | None], list[str]]]:
    """Runs of frames that touch or overlap put together."""
    merged: list[tuple[tuple[int | None, int | None], list[str]]] = []
    for (a, b), texts in sorted(said.items(), key=lambda item: (item[0][0] is None, item[0])):
        if merged and a is not None and merged[-1][0][1] is not None and a <= merged[-1][0][1] + 1:
            (first, last), before = merged[-1]
            merged[-1] = ((first, max(last or 0, b or 0)), before + texts)
        else:
            merged.append(((a, b), list(texts)))
    return merged


def _missing_end(promise: Promise, times_s: FloatArray) -> int:
    """Frames that the container promises and the file does not hold."""
    if promise.end_s is None or len(times_s) < 2:
        return 0
    step = float(np.median(np.diff(times_s)))
    missing_s = promise.end_s - (float(times_s[-1]) + step)
    return round(missing_s / step) if step > 0 and missing_s > 2.5 * step + 0.02 else 0


def _holes(witness: Witness, times_s: FloatArray, tick_s: float) -> list[dict[str, Any]]:
    """Frames lost between others, and times that do not rise."""
    steps = np.diff(times_s)
    rising = steps[steps > 0]
    if len(rising) < 8:
        return []
    step = float(np.median(rising))
    found = [
        _entry("time_order", int(n), int(n) + 1, f"The presentation time falls from frame {n} to {n + 1}.")
        for n in np.flatnonzero(steps <= 0)
    ]
    even = np.abs(steps - step) <= 0.02 * step + 1.01 * tick_s
    lost = np.rint(steps / step).astype(int) - 1
    stamps = {frame.pts for frame in witness.frames}
    undecoded = np.array(
        [p.pts for p in witness.packets if p.shown and p.pts is not None and p.pts not in stamps], np.float64
    )
    frame_stamps = [frame.pts for frame in witness.frames]
    for n in np.flatnonzero(lost >= 1):
        before, after = frame_stamps[n], frame_stamps[n + 1]
        if before is not None and after is not None and np.any((undecoded > before) & (undecoded < after)):
            text = f"{lost[n]} frames after frame {n} are in the file but could not be decoded."
            found.append(_entry("missing_frames", int(n), int(n) + 1, text))
        elif lost[n] >= LOST_IN_A_ROW and even.mean() >= 0.9:
            text = f"The times jump by {steps[n]:.2f} s after frame {n}: {lost[n]} frames are missing."
            found.append(_entry("time_gap", int(n), int(n) + 1, text))
    return found


def _told(texts: list[str]) -> str:
    different = list(dict.fromkeys(texts))
    more = f" (and {len(texts) - 1} more messages)" if len(texts) > 1 else ""
    return f"Broken: {different[0]}{more}."


def _quoted(texts: list[str]) -> str:
    return f" The container reader says: {texts[0]}." if texts else ""


def _entry(kind: str, first: int | None, last: int | None, message: str) -> dict[str, Any]:
    return {"kind": kind, "frame": first, "last_frame": last, "message": message}
