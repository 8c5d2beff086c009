"""Scan frames → fringe maps: one step a frame for the whole field, or steps that vary over it, solved jointly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.displacement import moved_back, slopes_at
from rahas.kernels.joint_steps import StepField, levelled
from rahas.kernels.long_scan import solve_scan_steps
from rahas.kernels.noise_memory import phase_std_inflation
from rahas.kernels.phase_field import solve_phase_field
from rahas.kernels.phase_shifting import (
    FringeMaps,
    HarmonicSums,
    weights_of_even_resampling,
    weights_of_least_squares,
)
from rahas.kernels.pixel_fit import fit_pixels
from rahas.kernels.sampling import evenly_spread
from rahas.params import PhaseParams
from rahas.stages.ahead import ahead
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

BLOCK = 16  # frames
MOST_SAMPLES = 450_000  # pixels times frames of the joint solve: long scans have fewer pixels, not more memory

ReadBlocks = Callable[[], Iterator[AnyArray]]
SolveField = Callable[[ReadBlocks, FloatArray, slice], FringeMaps]


def linear_maps(
    frames: FrameStack, first: int, steps: FloatArray, fields: list[slice], params: PhaseParams
) -> FringeMaps:
    """Fringe maps with one step (frame,) a frame: the thesis's resampling, or least squares over all frames.

    Raises
    ------
    CaptureProblem
        The crank scanned too little for a phase.
    """
    return _solve_fields(frames, first, steps, fields, _linear_field(params))


def joint_maps(
    frames: FrameStack,
    first: int,
    steps: FloatArray,
    fields: list[slice],
    *,
    start: FringeMaps,
    unwrapped: Float32Array,
    labelled: BoolArray,
    held: BoolArray,
    params: PhaseParams,
    top_level: float,
) -> tuple[FringeMaps, StepField]:
    """Fringe maps with steps that vary over the field, and the steps of the first field.

    ``start`` are the linear maps, ``unwrapped`` (y, x) their roughly known unwrapped phase, right where ``labelled``;
    ``held`` (frame,) says which frames show the slide at its reference position.
    """
    solved: list[StepField] = []
    solve_field = _joint_field(start, unwrapped, labelled, held, params, solved, top_level)
    return _solve_fields(frames, first, steps, fields, solve_field), solved[0]


def _solve_fields(
    frames: FrameStack,
    first: int,
    steps: FloatArray,
    fields: list[slice],
    solve_field: SolveField,
) -> FringeMaps:
    """Solve each field on its own rows with its own steps, and weave the maps together."""
    height, width = frames.shape[1:]
    woven = FringeMaps(*(np.empty((height, width), np.float32) for _ in FringeMaps._fields))
    moments = np.arange(len(steps))
    for number, rows in enumerate(fields):
        own = np.interp(moments + number / len(fields), moments, steps)
        found = solve_field(partial(_blocks, frames, first, first + len(own), rows), own, rows)
        for target, part in zip(woven, found, strict=True):
            target[rows] = part
    return woven


def _linear_field(params: PhaseParams) -> SolveField:
    """One step a frame for the whole field: the thesis's resampling, or least squares."""

    def solve_field(blocks: ReadBlocks, steps: FloatArray, rows: slice) -> FringeMaps:
        weights, used = _weights(steps, params)
        sums: HarmonicSums | None = None
        left = len(used)
        for block in blocks():
            sums = sums or HarmonicSums(block.shape[1:], used, weights)
            sums.add(block[:left])
            left -= min(left, len(block))
            if not left:
                break
        assert sums is not None
        return sums.maps()

    return solve_field


def _joint_field(
    start: FringeMaps,
    unwrapped: Float32Array,
    labelled: BoolArray,
    held: BoolArray,
    params: PhaseParams,
    solved: list[StepField],
    top_level: float,
) -> SolveField:
    """Steps that vary over the field, solved jointly with the phase; each field's are added to ``solved``."""
    steady = labelled & (start.phase_std < 4.0 * np.median(start.phase_std[labelled]))

    def solve_field(blocks: ReadBlocks, steps: FloatArray, rows: slice) -> FringeMaps:
        unclipped = start.background[rows] + start.modulation[rows] < top_level
        chosen = evenly_spread(steady[rows] & unclipped, min(params.joint_pixels, MOST_SAMPLES // len(steps)))
        levels = np.concatenate([block[:, chosen[0], chosen[1]] for block in blocks()])
        slopes = slopes_at(start.background[rows], start.modulation[rows], start.wrapped_phase[rows], chosen)
        field = solve_scan_steps(levels, unwrapped[rows][chosen].astype(float), steps, held, slopes)
        shift, field = field.shift, field.moved_back(slopes.carrier)
        if shift.any():
            blocks = partial(_steadied, blocks, shift)
            levels = np.concatenate([block[:, chosen[0], chosen[1]] for block in blocks()])
        solved.append(field)
        maps = solve_phase_field(blocks, unwrapped[rows], field, top_level=top_level)
        sample = FringeMaps(*(part[chosen] for part in maps))
        return maps._replace(phase_std=maps.phase_std * _inflation(levels, unwrapped[rows][chosen], sample, field))

    return solve_field


def _inflation(levels: AnyArray, unwrapped: Float32Array, sample: FringeMaps, field: StepField) -> np.float32:
    """What compression's lasting errors make of the phase's standard deviation, from some pixels (frame, pixel)."""
    fit = fit_pixels(
        levelled(levels.astype(np.float32), field),
        sample.wrapped_phase,
        field.steps_at(unwrapped).astype(np.float32),
        field.waveform.at(sample.background, sample.modulation),
    )
    return np.float32(phase_std_inflation(fit.residual, fit.value, fit.slope))


def _steadied(blocks: ReadBlocks, shift: FloatArray) -> Iterator[AnyArray]:
    return moved_back(blocks(), shift)


def _weights(steps: FloatArray, params: PhaseParams) -> tuple[FloatArray, FloatArray]:
    """Weights per frame and the steps of the frames they cover."""
    try:
        if params.method == "thesis":
            weights, used = weights_of_even_resampling(steps)
            count = int(np.flatnonzero(used)[-1]) + 1
            return weights[:, :count], steps[:count]
        return weights_of_least_squares(steps), steps
    except ValueError as error:
        raise CaptureProblem(
            "timeline",
            "periods",
            f"The crank moved the stripes too little for a phase ({error}): turn it from stop to stop.",
            value=float(np.ptp(steps) / (2 * np.pi)),
            limit=1.0 if params.method == "thesis" else 0.9,
            unit="period",
        ) from None


def _blocks(frames: FrameStack, first: int, end: int, rows: slice) -> Iterator[AnyArray]:
    return ahead(lambda start: frames[start : min(start + BLOCK, end)][:, rows], range(first, end, BLOCK), depth=1)
