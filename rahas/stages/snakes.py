"""Snakes: every stripe found, numbered and followed from the first hold to the end (thesis 3.4).

normalise, filter → un-rotate → PSR → mask → first labels → (track → grow) for each frame; streamed in blocks, so that
memory does not grow with the capture's length.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.peaks import PeakRule, Peaks, snake_mask_peak_psr
from rahas.kernels.snake_chains import Chains, chains_of_peaks, names_by_vote
from rahas.kernels.snake_growth import GrowthRule, drop_contradictions, multi_pass_grow
from rahas.kernels.snake_labels import first_names, first_positions
from rahas.kernels.snake_light import LEVEL_OFFSET, LightEnvelope, balanced, envelope_of_frames, pattern_levels, smoothed
from rahas.kernels.snake_tracking import Memory, memory_of_rows, remembered, track_snakes
from rahas.kernels.snakes import SnakeSet, blank_snakes, rows_from_names, snake_set_from_rows
from rahas.kernels.stripe_count import find_num_snakes
from rahas.kernels.unrotation import canvas_columns, unrotation_deg_from_slide_angle
from rahas.params import SnakesParams
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

BLOCK_FRAMES = 64
_READ_FRAMES = 16
_HOLD_FRAMES = 8
_ENVELOPE_FRAMES = 80
_FIRST_ENVELOPE_FRAMES = 24
_FIRST_AVERAGE_PX = 3
_MIN_STRIPES = 3


class SnakeTimeline(NamedTuple):
    """What tracking has to know of the capture's course."""

    slide_angle_deg: FloatArray
    """(frame) 0 at the first stop, 90 at the second; NaN in the dark."""
    rotation_sense: int
    """+1: the phase gradient turns from +x to +y in the image; −1: from −x to +y."""
    first_hold: tuple[int, int]
    """First and last frame (inclusive) of the hold before the rotation."""
    second_hold: tuple[int, int]
    """First and last frame of the hold after the rotation."""
    moving: tuple[tuple[int, int], ...]
    """First and last frame of rotation and scan."""
    lit: BoolArray
    """(frame) whether the lamp is on."""


class SnakeBlock(NamedTuple):
    """Snake matrix sets of consecutive frames."""

    first_frame: int
    identity: AnyArray
    """(frame, snake, x) int16 Si."""
    y: Float32Array
    """(frame, snake, x) Sy."""
    value: Float32Array
    """(frame, snake, x) Sp."""


class Tracking(NamedTuple):
    """First labels, and the snakes of all frames to be read once, block by block."""

    pitch_px: float
    """Distance of stripes in the first frame."""
    stripes_seen: int
    """Snakes of the first frame."""
    snakes: int
    """Rows of the snake matrices: those of the first frame and spare ones for stripes that enter below."""
    first_positions_px: FloatArray
    """(snake) canvas row of each snake at the canvas's middle column in the first frame."""
    unrotation_deg: FloatArray
    """(frame) NaN in the dark."""
    blocks: Iterator[SnakeBlock]


class _Tools(NamedTuple):
    """What is the same for all frames."""

    params: SnakesParams
    envelope: LightEnvelope
    average_px: int
    peaks: PeakRule
    growth: GrowthRule
    wide_px: float
    narrow_px: float
    chain_reach_px: float


def snake_timeline(
    intervals: Sequence[Mapping[str, Any]], slide_angle_deg: Sequence[float | None], rotation_sense: int
) -> SnakeTimeline:
    """What tracking has to know, from the content of timeline.json.

    Raises
    ------
    CaptureProblem
        There is no rotation.
    """
    spans = [(str(i["stage"]), int(i["first"]), int(i["last"])) for i in intervals]
    turning = [n for n, span in enumerate(spans) if span[0] == "rotation"]
    if not turning:
        raise CaptureProblem(
            "timeline", "stages", "The capture shows no rotation: turn the lever from stop to stop while filming."
        )
    at = turning[0]
    _, first, last = spans[at]
    before = spans[at - 1][1:] if at > 0 and spans[at - 1][0] == "hold" else (first, first)
    after = spans[at + 1][1:] if at + 1 < len(spans) and spans[at + 1][0] == "hold" else (last, last)
    lit = np.ones(len(slide_angle_deg), bool)
    for stage, begin, end in spans:
        lit[begin : end + 1] = stage != "dark"
    return SnakeTimeline(
        slide_angle_deg=np.array([np.nan if a is None else a for a in slide_angle_deg], dtype=np.float64),
        rotation_sense=rotation_sense,
        first_hold=before,
        second_hold=after,
        moving=tuple(span[1:] for span in spans if span[0] in ("rotation", "scan")),
        lit=lit,
    )


def track(
    frames: FrameStack, timeline: SnakeTimeline, params: SnakesParams, *, first_field: int | None = None
) -> Tracking:
    """Label the stripes of the first hold and follow them through every lit frame.

    Parameters
    ----------
    frames
        (frame, y, x) luma as shot.
    first_field
        Row (0 or 1) where the first field of interlaced frames begins; ``None``: progressive. Snakes are those of
        the first field, brought to full height.

    Raises
    ------
    CaptureProblem
        No stripes in the first hold; or, while blocks are read, the snakes are lost before the second hold.
    """
    reader = _Reader(frames, first_field)
    unrotation = unrotation_deg_from_slide_angle(timeline.slide_angle_deg, rotation_sense=timeline.rotation_sense)
    unrotation[~timeline.lit] = np.nan
    envelope = _envelope(reader, timeline, params, _FIRST_AVERAGE_PX, _FIRST_ENVELOPE_FRAMES)
    last = timeline.first_hold[1]
    start = max(timeline.first_hold[0], last - _HOLD_FRAMES + 1)
    angle = float(unrotation[last])
    mean = np.mean([reader.frame(n) for n in range(start, last + 1)], axis=0).astype(reader.dtype)
    calm = balanced(smoothed(mean, median_px=params.median_px, average_px=_FIRST_AVERAGE_PX), envelope)
    levels = canvas_columns(pattern_levels(calm, envelope), angle)
    stripes = find_num_snakes(np.where(levels > 0, levels - LEVEL_OFFSET, 0.0))
    tools = _tools(params, reader, timeline, stripes.pitch_px)
    _, peaks, chains = _peaks_and_chains(mean, angle, tools)
    names = first_names(peaks, chains, pitch_px=stripes.pitch_px)
    seen = int(names.max(initial=0))
    if seen < _MIN_STRIPES:
        raise CaptureProblem(
            "tracking", "snakes",
            "No stripes can be told apart in the hold before the rotation: check that the lever rested at its first "
            "stop, with the stripes upright in the image and sharp on the object.",
            value=seen, limit=_MIN_STRIPES, unit="stripes",
        )  # fmt: skip
    snakes = seen + params.spare_snakes
    rows = rows_from_names(peaks, names, snakes)
    return Tracking(
        pitch_px=stripes.pitch_px,
        stripes_seen=seen,
        snakes=snakes,
        first_positions_px=first_positions(names, peaks, snakes=snakes),
        unrotation_deg=unrotation,
        blocks=_blocks(reader, timeline, unrotation, rows, tools),
    )


class _Reader:
    """Frames one by one, the last block kept; interlaced frames by their first field at full height."""

    def __init__(self, frames: FrameStack, first_field: int | None) -> None:
        self._frames = frames
        self._first_field = first_field
        self._start = 0
        self._block: AnyArray = np.empty((0, *frames.shape[1:]), frames.dtype)
        self.count = frames.shape[0]
        self.shape = frames.shape[1:]
        self.dtype = frames.dtype

    def frame(self, number: int) -> AnyArray:
        if not self._start <= number < self._start + len(self._block):
            self._start = number - number % _READ_FRAMES
            self._block = np.asarray(self._frames[self._start : self._start + _READ_FRAMES])
        frame = self._block[number - self._start]
        return frame if self._first_field is None else _field_at_full_height(frame, self._first_field)


def _field_at_full_height(frame: AnyArray, first_row: int) -> AnyArray:
    """Rows ``first_row``, + 2, … kept, the others interpolated between them."""
    full = frame.copy()
    field = frame[first_row::2].astype(np.uint32)
    between = ((field[:-1] + field[1:] + 1) // 2).astype(frame.dtype)
    full[first_row + 1 : first_row + 1 + 2 * len(between) : 2] = between
    if first_row == 1:
        full[0] = frame[1]
    if (frame.shape[0] - first_row) % 2 == 0:
        full[-1] = frame[-2]
    return full


def _envelope(
    reader: _Reader, timeline: SnakeTimeline, params: SnakesParams, average_px: int, frames: int
) -> LightEnvelope:
    numbers = np.concatenate([np.arange(a, b + 1) for a, b in timeline.moving])
    numbers = numbers[timeline.lit[numbers]]
    numbers = numbers[np.unique(np.linspace(0, numbers.size - 1, frames).astype(int))]
    first, last = timeline.first_hold

    def calm(n: int) -> Float32Array:
        return smoothed(reader.frame(n), median_px=params.median_px, average_px=average_px)

    return envelope_of_frames(
        (calm(int(n)) for n in numbers),
        still=(calm(first + (last - first) // 3), calm(first + 2 * (last - first) // 3)),
        min_modulation_over_noise=params.min_modulation_over_noise,
    )


def _tools(params: SnakesParams, reader: _Reader, timeline: SnakeTimeline, pitch: float) -> _Tools:
    average_px = max(_FIRST_AVERAGE_PX, 2 * round(params.average_pitches * pitch / 2) + 1)
    envelope = _envelope(reader, timeline, params, average_px, _ENVELOPE_FRAMES)
    return _Tools(
        params=params,
        envelope=envelope,
        average_px=average_px,
        peaks=PeakRule(
            sidelobe_px=max(2, round(params.sidelobe_pitches * pitch)),
            min_psr=params.min_psr,
            min_level=LEVEL_OFFSET + params.min_level,
            half_window_px=max(1, round(pitch / 8)),
            min_separation_px=0.35 * pitch,
        ),
        growth=GrowthRule(
            pitch_px=pitch,
            gap_px=max(2, round(params.grow_gap_pitches * pitch)),
            reach_px=max(1.5, params.grow_reach_pitches * pitch),
            min_spacing=0.4,
            max_spacing=2.2,
            min_length_px=max(4, round(pitch / 2)),
        ),
        wide_px=0.45 * pitch,
        narrow_px=params.track_pitches * pitch,
        chain_reach_px=max(1.5, 0.05 * pitch),
    )


def _peaks_and_chains(frame: AnyArray, angle: float, tools: _Tools) -> tuple[Float32Array, Peaks, Chains]:
    calm = smoothed(frame, median_px=tools.params.median_px, average_px=tools.average_px)
    calm = balanced(calm, tools.envelope)
    peaks = snake_mask_peak_psr(canvas_columns(pattern_levels(calm, tools.envelope), angle), tools.peaks)
    return calm, peaks, chains_of_peaks(peaks, reach_px=tools.chain_reach_px)


def _blocks(
    reader: _Reader, timeline: SnakeTimeline, unrotation: FloatArray, rows: Float32Array, tools: _Tools
) -> Iterator[SnakeBlock]:
    snakes, width = rows.shape
    labelled = int(np.isfinite(rows).sum())
    memory = memory_of_rows(rows)
    for first in range(0, reader.count, BLOCK_FRAMES):
        sets = []
        for n in range(first, min(first + BLOCK_FRAMES, reader.count)):
            if not timeline.lit[n] or not np.isfinite(unrotation[n]):
                sets.append(blank_snakes(snakes, width))
                continue
            memory, one = _next_frame(reader.frame(n), float(unrotation[n]), memory, tools)
            sets.append(one)
            if n == timeline.second_hold[1]:
                _refuse_if_lost(np.count_nonzero(one.identity) / labelled, tools.params.min_tracked_share)
        yield SnakeBlock(
            first,
            np.stack([s.identity for s in sets]),
            np.stack([s.y for s in sets]),
            np.stack([s.value for s in sets]),
        )


def _next_frame(frame: AnyArray, angle: float, memory: Memory, tools: _Tools) -> tuple[Memory, SnakeSet]:
    """Track, let chains agree, drop what contradicts itself, grow, and check once more."""
    snakes = memory.y.shape[0]
    calm, peaks, chains = _peaks_and_chains(frame, angle, tools)
    tracked, motion = track_snakes(memory.y, peaks, wide_px=tools.wide_px, narrow_px=tools.narrow_px)
    names = names_by_vote(chains, tracked, min_agreement=0.8)
    names = drop_contradictions(peaks, chains, names, tools.growth)
    names = multi_pass_grow(peaks, chains, names, tools.growth, snakes=snakes)
    names = drop_contradictions(peaks, chains, names, tools.growth)
    rows = rows_from_names(peaks, names, snakes)
    return remembered(memory, rows, motion), snake_set_from_rows(rows, calm, angle)


def _refuse_if_lost(share: float, least: float) -> None:
    if share < least:
        raise CaptureProblem(
            "tracking", "snakes",
            "The stripes were lost between the first and the second hold: turn the lever more slowly and evenly, and "
            "keep the rig and the object still.",
            value=round(share, 3), limit=least, unit="share of the first frame's snake pixels",
        )  # fmt: skip
