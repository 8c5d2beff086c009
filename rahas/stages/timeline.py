"""Timeline of a capture: dark, hold, rotation, hold, scan, hold, dark, found from the frames themselves.

Works on thumbnails (means over 4 × 4 pixels): the stripes are far wider than that, noise is not. The order of work:
lit frames and the rough turn; the hold before the scan and the phase steps after it; with the background and
modulation that the scan gives, the slide's angle in the rotation; repeated and lost frames.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rahas.kernels.dropped_frames import DroppedFrames, gaps_in_time, identical_frames, lost_frames, repeated_frames
from rahas.params import TimelineParams
from rahas.stages.timeline_overview import look_over, timeline_problem
from rahas.stages.timeline_rotation import Rotation, find_rotation
from rahas.stages.timeline_scan import Scan, find_scan
from rahas.typing import FloatArray, FrameStack

TRANSIENT_S = 0.3
"""Swings of angle or step (a jolt of the rig) shorter than half of this do not move a border."""


class Interval(NamedTuple):
    """Frames ``first`` to ``last``, both inclusive, of one stage: dark, hold, rotation or scan."""

    stage: str
    first: int
    last: int


class Timeline(NamedTuple):
    """What happens when in a capture; see timeline.json in docs/ARCHITECTURE.md."""

    intervals: list[Interval]
    """Covering the capture in order."""
    duplicates: list[int]
    """Frames that repeat the one before."""
    dropped: list[DroppedFrames]
    """Frames missing from the record."""
    rotation_sense: int
    """+1: the phase gradient turns from +x to +y; −1: from −x to +y (y down)."""
    slide_angle_deg: FloatArray
    """(frame) 0 = first stop, 90 = second stop, NaN in the dark."""
    phase_step_rad: FloatArray
    """(frame) at the field's centre, 0 at the hold before the scan: frame n shows cos(Φ + step). NaN outside."""
    periods: float
    """Extent of the phase steps, pattern periods."""


def find_timeline(
    thumbnails: FrameStack,
    *,
    time_s: FloatArray,
    change: FloatArray,
    frame_rate: float,
    params: TimelineParams,
    thumbnail_scale: float = 1 / 64,
) -> Timeline:
    """Timeline of a capture.

    Parameters
    ----------
    thumbnails
        (frame, y, x) uint16, mean over 4 × 4 pixels over ``thumbnail_scale``; interlaced: of each frame's first field.
    time_s
        (frame) presentation times.
    change
        (frame) mean absolute difference from the frame before, whole frames, grey levels: 0 only for an exact repeat.
    frame_rate
        Frames a second.
    thumbnail_scale
        Grey levels a unit of a thumbnail.

    Raises
    ------
    CaptureProblem
        ``timeline``: the lamp, the rotation, the scan or a hold that is needed is missing.
    """
    stack = _in_memory(thumbnails)
    rate = frame_rate if np.isfinite(frame_rate) and frame_rate > 0 else 30.0
    median_frames = 2 * max(1, round(rate * TRANSIENT_S / 2)) + 1
    overview = look_over(stack, scale=thumbnail_scale)
    scan = find_scan(
        stack, overview, threshold_rad=params.scan_threshold_rad, median_frames=median_frames, scale=thumbnail_scale
    )
    rotation = find_rotation(
        stack,
        overview,
        scan,
        threshold_deg=params.rotation_threshold_deg,
        median_frames=median_frames,
        scale=thumbnail_scale,
    )
    frames = stack.shape[0]
    intervals = _intervals(frames, overview.lit_first, overview.lit_last, rotation, scan)
    number = np.arange(frames)
    turning = (number >= rotation.first) & (number <= rotation.last)
    scanning = (number >= scan.scan_first) & (number <= scan.scan_last)
    travels = [np.where(turning, rotation.angle_deg, np.nan), np.where(scanning, scan.step, np.nan)]
    repeated: set[int] = set()
    for travel in travels:
        repeated |= set(repeated_frames(overview.change.rms, travel, noise=overview.change.noise))
    for interval in intervals:
        if interval.stage != "dark":
            within = change[interval.first : interval.last + 1]
            repeated |= {n + interval.first for n in identical_frames(within)}
    duplicates = sorted(repeated)
    lost = gaps_in_time(time_s)
    for travel in travels:
        lost += _lost_in(travel, time_s, duplicates)
    return Timeline(
        intervals=intervals,
        duplicates=duplicates,
        dropped=sorted({gap.after: gap for gap in reversed(lost)}.values()),
        rotation_sense=overview.sense,
        slide_angle_deg=rotation.angle_deg,
        phase_step_rad=np.where(scanning, scan.step, np.nan),
        periods=float(np.nanmax(scan.step) - np.nanmin(scan.step)) / (2 * np.pi),
    )


IN_MEMORY_BYTES = 40_000_000
"""Thumbnails up to this size are read once; larger ones are read block by block in each pass."""


def _in_memory(thumbnails: FrameStack) -> FrameStack:
    size = int(np.prod(thumbnails.shape)) * thumbnails.dtype.itemsize
    return np.asarray(thumbnails[:]) if size <= IN_MEMORY_BYTES else thumbnails


def _intervals(frames: int, lit_first: int, lit_last: int, rotation: Rotation, scan: Scan) -> list[Interval]:
    """The stages in order; empty ones (dark, last hold) are left out."""
    if rotation.first - lit_first < 3:
        raise timeline_problem(
            "The lever was already moving when the lamp came on or filming began: there is no hold at the first stop. "
            "Wait a second with the lamp on before turning the lever.",
            "lamp on, no hold, rotation, hold, scan",
        )
    if scan.scan_first - max(rotation.last + 1, scan.still_from) < 2:
        raise timeline_problem(
            "The crank was turned before the lever had reached its stop: there is no hold between rotation and scan, "
            "so the reference slide position is unknown. Wait a second at the lever's stop before cranking.",
            "lamp on, hold, rotation, no hold, scan",
        )
    borders = [
        ("dark", 0),
        ("hold", lit_first),
        ("rotation", rotation.first),
        ("hold", rotation.last + 1),
        ("scan", scan.scan_first),
        ("hold", scan.scan_last + 1),
        ("dark", lit_last + 1),
        ("end", frames),
    ]
    return [
        Interval(stage, first, following - 1)
        for (stage, first), (_, following) in pairwise(borders)
        if following > first
    ]


def _lost_in(travel: FloatArray, time_s: FloatArray, repeated: list[int]) -> list[DroppedFrames]:
    bend = np.diff(travel, 3)
    bend = bend[np.isfinite(bend)]
    noise = 1.4826 * float(np.median(np.abs(bend))) / np.sqrt(20) if bend.size else 0.0
    return lost_frames(travel, time_s, noise=noise, repeated=repeated)
