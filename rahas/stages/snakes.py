"""Snakes: every stripe found, numbered and followed from the first hold to the end (thesis 3.4).

normalise, filter → un-rotate → PSR → mask → first labels → (track → grow) for each frame; streamed in blocks, so that
memory does not grow with the capture's length.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.interlacing import PROGRESSIVE
from rahas.kernels.peaks import Peaks
from rahas.kernels.snake_labels import first_names, first_positions, stripe_numbers
from rahas.kernels.snake_light import (
    LEVEL_OFFSET,
    LightEnvelope,
    balanced,
    envelope_of_frames,
    pattern_levels,
    smoothed,
)
from rahas.kernels.snake_prediction import Prediction, first_prediction
from rahas.kernels.snake_tracking import memory_of_rows
from rahas.kernels.snakes import SnakeSet, blank_snakes, rows_from_names
from rahas.kernels.stripe_count import StripeCount, find_num_snakes
from rahas.kernels.unrotation import canvas_columns, canvas_matrix, unrotation_deg_from_slide_angle
from rahas.params import SnakesParams
from rahas.stages.ahead import ahead
from rahas.stages.snake_frames import FrameReader, State, Tools, Turn, next_frame, seen, tools_for
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

BLOCK_FRAMES = 64
BLOCK_POINTS = 2_500_000
"""Snake points of a block, on all its frames: wide images come in shorter blocks."""
AHEAD_PIXELS = 1_300_000
"""Of the frames looked at before they are tracked."""
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
    block_frames: int
    """Frames of a block."""
    blocks: Iterator[SnakeBlock]


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
    frames: FrameStack, timeline: SnakeTimeline, params: SnakesParams, *, field_order: str = PROGRESSIVE
) -> Tracking:
    """Label the stripes of the first hold and follow them through every lit frame.

    Parameters
    ----------
    frames
        (frame, y, x) luma as shot.
    field_order
        ``progressive``, ``top_first`` or ``bottom_first``. Snakes are those of the first field, at full height.

    Raises
    ------
    CaptureProblem
        No stripes in the first hold; or, while blocks are read, the snakes are lost before the second hold.
    """
    reader = FrameReader(frames, field_order)
    unrotation = unrotation_deg_from_slide_angle(timeline.slide_angle_deg, rotation_sense=timeline.rotation_sense)
    unrotation[~timeline.lit] = np.nan
    _refuse_without_light(reader, timeline)
    envelope = _envelope(reader, timeline, params, _FIRST_AVERAGE_PX, _FIRST_ENVELOPE_FRAMES)
    last = timeline.first_hold[1]
    start = max(timeline.first_hold[0], last - _HOLD_FRAMES + 1)
    angle = float(unrotation[last])
    mean = _mean_frame(reader, start, last)
    calm = balanced(smoothed(mean, median_px=params.median_px, average_px=_FIRST_AVERAGE_PX), envelope)
    levels = canvas_columns(pattern_levels(calm, envelope), angle)
    try:
        stripes = find_num_snakes(np.where(levels > 0, levels - LEVEL_OFFSET, 0.0))
    except ValueError as problem:
        raise _no_stripes(0) from problem
    average_px = max(_FIRST_AVERAGE_PX, 2 * round(params.average_pitches * stripes.pitch_px / 2) + 1)
    envelope = _envelope(reader, timeline, params, average_px, _ENVELOPE_FRAMES)
    tools = tools_for(params, envelope=envelope, average_px=average_px, pitch_px=stripes.pitch_px)
    first = seen(mean, angle, tools)
    peaks = first.peaks
    names = first_names(peaks, first.chains, pitch_px=stripes.pitch_px)
    count = int(names.max(initial=0))
    if count < _MIN_STRIPES:
        raise _no_stripes(count)
    snakes = count + params.spare_snakes
    block = BLOCK_FRAMES
    while block > 8 and block * snakes * reader.shape[1] > BLOCK_POINTS:
        block //= 2
    rows = rows_from_names(peaks, names, snakes)
    return Tracking(
        pitch_px=stripes.pitch_px,
        stripes_seen=count,
        snakes=snakes,
        first_positions_px=first_positions(names, peaks, snakes=snakes),
        unrotation_deg=unrotation,
        block_frames=block,
        blocks=_blocks(
            reader, timeline, unrotation, rows, _prediction(names, peaks, reader.shape, angle, stripes), tools, block
        ),
    )


def _mean_frame(reader: FrameReader, first: int, last: int) -> AnyArray:
    """Mean of still frames, uint16; 8-bit frames times 256, so that the mean of noisy ones keeps its fractions."""
    mean = np.mean([reader.frame(n) for n in range(first, last + 1)], axis=0)
    out: AnyArray = np.rint(mean * (256 if reader.dtype == np.uint8 else 1)).astype(np.uint16)
    return out


def _no_stripes(count: int) -> CaptureProblem:
    return CaptureProblem(
        "tracking", "snakes",
        "No stripes can be told apart in the hold before the rotation: check that the lever rested at its first "
        "stop, with the stripes upright in the image and sharp on the object.",
        value=count, limit=_MIN_STRIPES, unit="stripes",
    )  # fmt: skip


def _refuse_without_light(reader: FrameReader, timeline: SnakeTimeline) -> None:
    if not reader.frame(timeline.first_hold[1]).any() or not np.isfinite(
        timeline.slide_angle_deg[timeline.first_hold[1]]
    ):
        raise _no_stripes(0)


def _envelope(
    reader: FrameReader, timeline: SnakeTimeline, params: SnakesParams, average_px: int, frames: int
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


def _prediction(
    names: AnyArray, peaks: Peaks, shape: tuple[int, ...], angle: float, stripes: StripeCount
) -> Prediction:
    height, width = shape
    cell = int(np.clip(stripes.pitch_px / 6, 1, 6))
    y, x = np.mgrid[0:height:cell, 0:width:cell].astype(np.float64)
    matrix = canvas_matrix(angle, height=height, width=width)
    canvas_x, canvas_y = (row[0] * x + row[1] * y + row[2] for row in matrix)
    numbers = stripe_numbers(names, peaks, canvas_x, canvas_y)
    return first_prediction(numbers, cell_px=cell, pitch_px=stripes.pitch_px)


def _blocks(
    reader: FrameReader,
    timeline: SnakeTimeline,
    unrotation: FloatArray,
    rows: Float32Array,
    prediction: Prediction,
    tools: Tools,
    block_frames: int,
) -> Iterator[SnakeBlock]:
    snakes, width = rows.shape
    labelled = int(np.isfinite(rows).sum())
    state = State(memory_of_rows(rows), prediction)
    kept = 0.0
    shown = timeline.lit & np.isfinite(unrotation)
    sights = ahead(
        lambda n: seen(reader.frame(n), float(unrotation[n]), tools),
        np.flatnonzero(shown).tolist(),
        depth=int(np.clip(AHEAD_PIXELS // (reader.shape[0] * reader.shape[1]), 1, 3)),
    )
    blank = blank_snakes(snakes, width)
    for first in range(0, reader.count, block_frames):
        count = min(block_frames, reader.count - first)
        sets = SnakeBlock(first, *(np.empty((count, *part.shape), part.dtype) for part in blank))
        for n in range(first, first + count):
            if not shown[n]:
                _put(sets, n, blank)
                continue
            turn = Turn(float(unrotation[n]), float(timeline.slide_angle_deg[n]))
            state, one = next_frame(next(sights), turn, state, tools)
            _put(sets, n, one)
            if timeline.second_hold[0] <= n <= timeline.second_hold[1]:
                kept = max(kept, np.count_nonzero(one.identity) / labelled)
            if n == timeline.second_hold[1]:
                _refuse_if_lost(kept, tools.params.min_tracked_share)
        yield sets


def _put(block: SnakeBlock, number: int, one: SnakeSet) -> None:
    """Set frame ``number`` of a block."""
    place = number - block.first_frame
    block.identity[place], block.y[place], block.value[place] = one.identity, one.y, one.value


def _refuse_if_lost(share: float, least: float) -> None:
    if share < least:
        raise CaptureProblem(
            "tracking", "snakes",
            "The stripes were lost between the first and the second hold: turn the lever more slowly and evenly, and "
            "keep the rig and the object still.",
            value=round(share, 3), limit=least, unit="share of the first frame's snake pixels",
        )  # fmt: skip
