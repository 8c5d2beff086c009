"""Geometry of the small drawings that stand in the page itself: the timeline strip and thin line plots (SVG)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rahas.report.words import number

WIDTH, LEFT, RIGHT = 720.0, 46.0, 712.0
PLOT_TOP, PLOT_BOTTOM = 10.0, 96.0


class Band(NamedTuple):
    """One interval of the timeline: its place on the axis and what it is called there (empty if too narrow)."""

    stage: str
    x: float
    width: float
    label: str


class Tick(NamedTuple):
    """A place on an axis and what is written there."""

    at: float
    label: str


class Strip(NamedTuple):
    """The timeline as a strip: bands, the frames that are pictured, seconds along the axis."""

    bands: list[Band]
    marks: list[Tick]
    seconds: list[Tick]


class LinePlot(NamedTuple):
    """One series per frame as thin lines (a gap starts a new one), over the timeline's bands."""

    title: str
    unit: str
    lines: list[str]
    ticks: list[Tick]
    bands: list[Band]


def frame_position(frame: float, frames: int) -> float:
    """Place of a frame on the common axis; frame 0 starts at LEFT, the end of the last frame is RIGHT."""
    return LEFT + (RIGHT - LEFT) * (frame / max(frames, 1))


def bands_of(timeline: Mapping[str, Any]) -> list[Band]:
    """The timeline's intervals on the common axis."""
    frames = int(timeline["frames"])
    bands = []
    for interval in timeline["intervals"]:
        start = frame_position(interval["first"], frames)
        width = frame_position(interval["last"] + 1, frames) - start
        label = interval["stage"] if width > 9.0 * len(interval["stage"]) else ""
        bands.append(Band(interval["stage"], round(start, 1), round(width, 1), label))
    return bands


def strip_of(timeline: Mapping[str, Any], pictured: Sequence[int]) -> Strip:
    """The strip for a timeline; ``pictured`` frames are marked a, b, c …"""
    frames, rate = int(timeline["frames"]), float(timeline.get("frame_rate") or 0.0)
    marks = [Tick(round(frame_position(n + 0.5, frames), 1), chr(ord("a") + k)) for k, n in enumerate(pictured)]
    seconds = []
    if rate > 0:
        step = _round_step(frames / rate / 8.0)
        count = int(frames / rate / step + 1e-9)
        seconds = [Tick(round(frame_position(k * step * rate, frames), 1), number(k * step)) for k in range(count + 1)]
    return Strip(bands_of(timeline), marks, seconds)


def line_plot(
    title: str, unit: str, values: Sequence[float | None], timeline: Mapping[str, Any], *, step: float | None = None
) -> LinePlot | None:
    """A plot of one number per frame, ``step`` apart from tick to tick; ``None`` if nothing is known in any frame."""
    known = [float(v) for v in values if v is not None and math.isfinite(v)]
    if not known:
        return None
    low, high = min(known), max(known)
    if low >= 0 and low < 0.5 * high:
        low = 0.0
    if not high > low:
        low, high = low - 0.5, high + 0.5
    step = step or _round_step((high - low) / 3.0)
    low, high = math.floor(low / step + 0.02) * step, math.ceil(high / step - 0.02) * step
    scale = (PLOT_BOTTOM - PLOT_TOP) / (high - low)
    frames = int(timeline["frames"])
    lines: list[list[str]] = [[]]
    for frame, value in enumerate(values):
        if value is None or not math.isfinite(value):
            if lines[-1]:
                lines.append([])
            continue
        row = PLOT_BOTTOM - (float(value) - low) * scale
        lines[-1].append(f"{frame_position(frame + 0.5, frames):.1f},{row:.1f}")
    count = round((high - low) / step)
    ticks = [
        Tick(round(PLOT_BOTTOM - k * step * scale, 1), number(low + k * step, span=step)) for k in range(count + 1)
    ]
    return LinePlot(title, unit, [" ".join(line) for line in lines if line], ticks, bands_of(timeline))


def _round_step(least: float) -> float:
    """The smallest of 1, 2, 5 × 10ⁿ that is not below ``least``."""
    if not least > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= least * (1 - 1e-9))
