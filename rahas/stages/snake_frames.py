"""One frame: what it shows, and how its snakes follow from those of the frame before (thesis 3.4.1, 3.4.3, 3.4.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.interlacing import first_field_full_height
from rahas.kernels.peaks import PeakRule, Peaks, snake_mask_peak_psr
from rahas.kernels.snake_chains import Chains, chains_of_peaks, names_added, names_by_vote
from rahas.kernels.snake_growth import GrowthRule, drop_contradictions, multi_pass_grow
from rahas.kernels.snake_light import LEVEL_OFFSET, LightEnvelope, balanced, pattern_levels, smoothed
from rahas.kernels.snake_prediction import (
    NO_NAME,
    Prediction,
    agreement,
    predicted,
    predicted_names,
    without_contradicted,
)
from rahas.kernels.snake_tracking import Memory, remembered, track_snakes
from rahas.kernels.snakes import SnakeSet, rows_from_names, snake_set_from_rows
from rahas.kernels.unrotation import canvas_columns
from rahas.params import SnakesParams
from rahas.typing import AnyArray, Float32Array, FrameStack

_READ_FRAMES = 8
_MIN_PREDICTED = 0.5
"""Prediction counts in a frame only where tracking bears it out at this share of the peaks at least."""


class FrameReader:
    """Frames one by one, the last block kept; interlaced frames by their first field at full height."""

    def __init__(self, frames: FrameStack, field_order: str) -> None:
        self._frames = frames
        self._field_order = field_order
        self._start = 0
        self._block: AnyArray = np.empty((0, *frames.shape[1:]), frames.dtype)
        self.count = frames.shape[0]
        self.shape = frames.shape[1:]
        self.dtype = frames.dtype

    def frame(self, number: int) -> AnyArray:
        """Frame ``number`` (y, x)."""
        if not self._start <= number < self._start + len(self._block):
            self._start = number - number % _READ_FRAMES
            self._block = np.asarray(self._frames[self._start : self._start + _READ_FRAMES])
        return first_field_full_height(self._block[number - self._start], self._field_order)


class Tools(NamedTuple):
    """What is the same for all frames."""

    params: SnakesParams
    envelope: LightEnvelope
    average_px: int
    peaks: PeakRule
    growth: GrowthRule
    wide_px: float
    narrow_px: float
    chain_reach_px: float


def tools_for(params: SnakesParams, *, envelope: LightEnvelope, average_px: int, pitch_px: float) -> Tools:
    """Sizes in pixels from the parameters' shares of the pitch."""
    pitch = pitch_px
    return Tools(
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
            grow_min_spacing=0.6,
            grow_max_spacing=1.7,
            min_length_px=max(4, round(pitch / 2)),
        ),
        wide_px=0.45 * pitch,
        narrow_px=params.track_pitches * pitch,
        chain_reach_px=max(1.5, 0.05 * pitch),
    )


class Sight(NamedTuple):
    """What a frame shows by itself, whatever the frames before it showed."""

    calm: Float32Array
    """(y, x) balanced and smoothed."""
    levels: Float32Array
    """(y, x) the pattern alone."""
    peaks: Peaks
    chains: Chains


def seen(frame: AnyArray, angle: float, tools: Tools) -> Sight:
    """A frame balanced and smoothed, its pattern levels, its peaks and their chains."""
    calm = smoothed(frame, median_px=tools.params.median_px, average_px=tools.average_px)
    calm = balanced(calm, tools.envelope)
    levels = pattern_levels(calm, tools.envelope)
    peaks = snake_mask_peak_psr(canvas_columns(levels, angle), tools.peaks)
    return Sight(calm, levels, peaks, chains_of_peaks(peaks, reach_px=tools.chain_reach_px))


class Turn(NamedTuple):
    unrotation_deg: float
    slide_angle_deg: float


class State(NamedTuple):
    """What is carried from frame to frame."""

    memory: Memory
    prediction: Prediction


def next_frame(sight: Sight, turn: Turn, state: State, tools: Tools) -> tuple[State, SnakeSet]:
    """Track, let chains agree, drop what contradicts prediction or itself, grow, and check once more."""
    memory = state.memory
    snakes = memory.y.shape[0]
    calm, levels, peaks, chains = sight
    tracked, motion = track_snakes(memory.y, peaks, wide_px=tools.wide_px, narrow_px=tools.narrow_px)
    prediction = predicted(state.prediction, levels, slide_angle_deg=turn.slide_angle_deg)
    expected = predicted_names(
        prediction, peaks, unrotation_deg=turn.unrotation_deg, height=calm.shape[0], width=calm.shape[1]
    )
    if agreement(tracked, expected) < _MIN_PREDICTED:
        expected[:] = NO_NAME
    names = names_by_vote(chains, without_contradicted(tracked, expected), min_agreement=0.8)
    known = np.where(expected <= snakes, np.maximum(expected, 0), 0)
    names = names_added(chains, names, known, min_share=0.7, min_length_px=tools.growth.min_length_px)
    names = without_contradicted(names, expected)
    names = drop_contradictions(peaks, chains, names, tools.growth)
    names = without_contradicted(multi_pass_grow(peaks, chains, names, tools.growth, snakes=snakes), expected)
    names = drop_contradictions(peaks, chains, names, tools.growth)
    rows = rows_from_names(peaks, names, snakes)
    return State(remembered(memory, rows, motion), prediction), snake_set_from_rows(rows, calm, turn.unrotation_deg)
