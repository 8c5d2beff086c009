"""Snakes and scan frames → wrapped phase, fringe order and unwrapped phase (thesis 3.5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.displacement import moved_back, slopes_at
from rahas.kernels.joint_steps import StepField, levelled
from rahas.kernels.noise_memory import phase_std_inflation
from rahas.kernels.phase_field import expected_noise, solve_phase_field
from rahas.kernels.phase_shifting import (
    TURN,
    FringeMaps,
    HarmonicSums,
    weights_of_even_resampling,
    weights_of_least_squares,
)
from rahas.kernels.pixel_fit import fit_pixels
from rahas.kernels.sampling import evenly_spread, with_smooth_guess
from rahas.kernels.snake_steps import fill_missing_steps, steps_from_snakes
from rahas.kernels.steady_steps import solve_steady_steps
from rahas.kernels.unwrapping import (
    UNKNOWN_ORDER,
    Orders,
    blank_near_snakes,
    coarse_turns_from_snakes,
    grow_orders,
    orders_from_coarse,
)
from rahas.params import PhaseParams
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

BLOCK = 16  # frames
QUANTISATION = 0.3  # grey levels: standard deviation of rounding
MIN_LABELLED = 500  # pixels
MOST_SAMPLES = 600_000  # pixels times frames of the joint solve: long scans have fewer pixels, not more memory
CENTRE = 8  # pixels: half the side of the patch that is the field's centre


class ScanSnakes(NamedTuple):
    """Snake matrices of the reference frame and of the scan's frames."""

    reference_identity: AnyArray  # (snake, x)
    reference_y: AnyArray  # (snake, x)
    identity: AnyArray  # (frame, snake, x)
    y: AnyArray  # (frame, snake, x)


class PhaseResult(NamedTuple):
    """All that phase.zarr holds, on the camera's grid (y, x) unless noted."""

    wrapped_phase: Float32Array
    unwrapped_phase: Float32Array
    fringe_order: AnyArray
    order_confidence: Float32Array
    background: Float32Array
    modulation: Float32Array
    phase_std: Float32Array
    chi2: Float32Array  # squared residual over that of pixels of like brightness
    quality: Float32Array
    steps: FloatArray  # (frame,) of the frames used, radians, first field


def solve(
    frames: FrameStack,
    *,
    first: int,
    last: int,
    held: int,
    fields: list[slice],
    snakes: ScanSnakes,
    first_order: int,
    params: PhaseParams,
    top_level: float = np.inf,
) -> PhaseResult:
    """Phase of every pixel at the reference slide position, the slide's place in frame ``first``.

    Parameters
    ----------
    frames
        (frame, y, x), luma.
    first, last
        The reference frame, and the last frame of the scan, both inclusive.
    held
        How many frames, from ``first`` on, show the slide at its reference position.
    fields
        Rows of each field in temporal order: one slice for progressive frames.
    snakes
        Snake matrices; those of the scan's frames are ``first`` … ``last``.
    first_order
        Fringe order of the maximum that snake 1 lies on.
    top_level
        Grey level from which on the sensor is saturated: the joint method leaves such frames of a pixel out.

    Raises
    ------
    CaptureProblem
        The crank scanned too little for a phase.
    """
    steps = _steps(snakes, frames.shape[1], held)
    snakes = snakes._replace(identity=snakes.identity[:0].copy(), y=snakes.y[:0].copy())  # of a long scan: 80 MB
    coarse = coarse_turns_from_snakes(
        snakes.reference_identity,
        snakes.reference_y,
        frames.shape[1],
        first_order=first_order,
        reach=params.outer_reach,
    )
    maps = _solve_fields(frames, first, steps, fields, _linear_field(params))
    if params.method == "joint":
        order, _ = _orders(maps, coarse, _measured(maps, params), params)
        labelled = order != UNKNOWN_ORDER
        if labelled.sum() < MIN_LABELLED:
            raise CaptureProblem(
                "tracking",
                "labelled_pixels",
                "The stripes could not be told apart on enough of the surface: turn the lever more slowly, and look "
                "that the stripes are sharp and bright on the object.",
                value=int(labelled.sum()),
                limit=MIN_LABELLED,
                unit="pixel",
            )
        unwrapped = with_smooth_guess(maps.wrapped_phase + TURN * order, labelled)
        solved: list[StepField] = []
        held_frames = np.arange(len(steps)) < held
        maps = _solve_fields(
            frames,
            first,
            steps,
            fields,
            _joint_field(maps, unwrapped, labelled, held_frames, params, solved, top_level),
        )
        steps = solved[0].steps_at(np.array([np.median(_centre(unwrapped))]))[:, 0]
    measured = _measured(maps, params)
    order, confidence = _orders(maps, coarse, measured, params)
    if params.method == "thesis":
        order = blank_near_snakes(order, snakes.reference_identity, snakes.reference_y, params.thesis_blanked_rows)
    return _assembled(maps, order, confidence, measured, steps)


def _orders(maps: FringeMaps, coarse: Float32Array, measured: BoolArray, params: PhaseParams) -> Orders:
    """Orders by snakes and, but for the thesis, carried on to where no snake reaches."""
    order, confidence = orders_from_coarse(maps.wrapped_phase, coarse, measured)
    if params.method != "thesis":
        order = grow_orders(
            order, maps.wrapped_phase, measured, steps=params.growth_px, tolerance=params.growth_tolerance_rad
        )
    return Orders(order, confidence)


def _measured(maps: FringeMaps, params: PhaseParams) -> BoolArray:
    noise = np.maximum(maps.residual_std, QUANTISATION)
    return maps.modulation > params.min_modulation_to_noise * noise


def _steps(snakes: ScanSnakes, height: int, held: int) -> FloatArray:
    middle = (0.3 * height, 0.7 * height)
    found = steps_from_snakes(
        reference_identity=snakes.reference_identity,
        reference_y=snakes.reference_y,
        identity=snakes.identity,
        y=snakes.y,
        rows=middle,
    )
    steps = fill_missing_steps(found)
    return steps - np.median(steps[:held])


def _solve_fields(
    frames: FrameStack,
    first: int,
    steps: FloatArray,
    fields: list[slice],
    solve_field: Callable[[Callable[[], Iterator[AnyArray]], FloatArray, slice], FringeMaps],
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


def _linear_field(params: PhaseParams) -> Callable[[Callable[[], Iterator[AnyArray]], FloatArray, slice], FringeMaps]:
    """One step a frame for the whole field: the thesis's resampling, or least squares."""

    def solve_field(blocks: Callable[[], Iterator[AnyArray]], steps: FloatArray, rows: slice) -> FringeMaps:
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
) -> Callable[[Callable[[], Iterator[AnyArray]], FloatArray, slice], FringeMaps]:
    """Steps that vary over the field, solved jointly with the phase; each field's are added to ``solved``."""
    steady = labelled & (start.phase_std < 4.0 * np.median(start.phase_std[labelled]))

    def solve_field(blocks: Callable[[], Iterator[AnyArray]], steps: FloatArray, rows: slice) -> FringeMaps:
        unclipped = start.background[rows] + start.modulation[rows] < top_level
        chosen = evenly_spread(steady[rows] & unclipped, min(params.joint_pixels, MOST_SAMPLES // len(steps)))
        levels = np.concatenate([block[:, chosen[0], chosen[1]] for block in blocks()])
        slopes = slopes_at(start.background[rows], start.modulation[rows], start.wrapped_phase[rows], chosen)
        field = solve_steady_steps(levels, unwrapped[rows][chosen].astype(float), steps, held, slopes)
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


def _steadied(blocks: Callable[[], Iterator[AnyArray]], shift: FloatArray) -> Iterator[AnyArray]:
    return moved_back(blocks(), shift)


def _centre(field: AnyArray) -> AnyArray:
    """The middle of a field (y, x)."""
    y, x = field.shape[0] // 2, field.shape[1] // 2
    return field[max(y - CENTRE, 0) : y + CENTRE, max(x - CENTRE, 0) : x + CENTRE]


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
    for start in range(first, end, BLOCK):
        yield frames[start : min(start + BLOCK, end)][:, rows]


def _assembled(
    maps: FringeMaps, order: AnyArray, confidence: Float32Array, measured: BoolArray, steps: FloatArray
) -> PhaseResult:
    nothing = np.float32(np.nan)
    has_order = order != UNKNOWN_ORDER
    expected = expected_noise(maps.background, maps.modulation, maps.residual_std)
    where: Callable[[AnyArray, BoolArray], Float32Array] = lambda a, m: np.where(m, a, nothing).astype(np.float32)  # noqa: E731
    unwrapped = maps.wrapped_phase + 2.0 * np.pi * order
    return PhaseResult(
        wrapped_phase=where(maps.wrapped_phase, measured),
        unwrapped_phase=where(unwrapped, has_order),
        fringe_order=np.where(has_order, order, UNKNOWN_ORDER).astype(np.int16),
        order_confidence=np.where(has_order, confidence, 0.0).astype(np.float32),
        background=maps.background,
        modulation=maps.modulation,
        phase_std=where(maps.phase_std, measured),
        chi2=where((maps.residual_std / expected) ** 2, measured),
        quality=(0.5 * len(steps) * maps.modulation).astype(np.float32),
        steps=steps,
    )
