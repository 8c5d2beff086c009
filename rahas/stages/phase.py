"""Snakes, rotation and scan frames → wrapped phase, fringe order and unwrapped phase (thesis 3.5, appendix B)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.phase_field import expected_noise
from rahas.kernels.phase_shifting import TURN, FringeMaps
from rahas.kernels.sampling import with_smooth_guess
from rahas.kernels.snake_steps import fill_missing_steps, steps_from_snakes
from rahas.kernels.unwrapping import (
    UNKNOWN_ORDER,
    blank_near_snakes,
    coarse_turns_from_snakes,
    grow_orders,
    orders_from_coarse,
)
from rahas.params import PhaseParams
from rahas.stages import orders
from rahas.stages.phase_maps import joint_maps, linear_maps
from rahas.stages.rotation_frames import Rotation, Scanned
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

QUANTISATION = 0.3  # grey levels: standard deviation of rounding
MIN_LABELLED = 500  # pixels
SNAKE_BLOCK = 64  # frames
CENTRE = 8  # pixels: half the side of the patch that is the field's centre


class ScanSnakes(NamedTuple):
    """Snake matrices (frame, snake, x) of the whole capture, read block by block."""

    identity: FrameStack
    y: FrameStack


class Labelled(NamedTuple):
    """Fringe orders, and how snakes and rotation code went together."""

    order: AnyArray  # (y, x) int16, −32768 where unknown
    confidence: Float32Array  # (y, x), 0 … 1
    confident_share: float | None = None  # of the measured pixels, by the rotation code; None: it was not asked
    disagreement: float | None = None  # share of differing orders where both know one


class PhaseResult(NamedTuple):
    """All that phase.zarr holds, on the camera's grid (y, x) unless noted; NaN (order: −32768): not measured."""

    wrapped_phase: Float32Array
    unwrapped_phase: Float32Array
    fringe_order: AnyArray
    order_confidence: Float32Array
    background: Float32Array
    modulation: Float32Array
    phase_std: Float32Array
    chi2: Float32Array  # squared residual over that of pixels of like brightness
    quality: Float32Array
    steps: FloatArray  # (frame,) of the frames used, radians, first field, at the field's centre
    labelled: Labelled


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
    rotation: Rotation | None = None,
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
        Snake matrices of the whole capture.
    first_order
        Fringe order of the maximum that snake 1 lies on.
    rotation
        The slide's turn, for the rotation code; ``None``, and in thesis mode: orders come from the snakes alone.
    top_level
        Grey level from which on the sensor is saturated: the joint method leaves such frames of a pixel out.

    Raises
    ------
    CaptureProblem
        The crank scanned too little for a phase, or the stripes could not be told apart.
    """
    steps = _steps(snakes, first, last, frames.shape[1], held)
    identity, rows = snakes.identity[first], snakes.y[first]
    coarse = coarse_turns_from_snakes(
        identity, rows, frames.shape[1], first_order=first_order, reach=params.outer_reach
    )
    maps = linear_maps(frames, first, steps, fields, params)
    if params.method == "thesis":
        measured = _measured(maps, params)
        order, confidence = orders_from_coarse(maps.wrapped_phase, coarse, measured)
        order = blank_near_snakes(order, identity, rows, params.thesis_blanked_rows)
        return _assembled(maps, Labelled(order, confidence), measured, steps)
    code: orders.RotationFit | None = None
    if rotation is not None:
        code = orders.fit(frames, rotation, fields=fields, scanned=_scanned(maps, params))
    labelled = _labelled(maps, coarse, code, params)
    if params.method == "joint":
        known = labelled.order != UNKNOWN_ORDER
        _refuse_if_lost(known)
        unwrapped = with_smooth_guess(maps.wrapped_phase + TURN * labelled.order, known)
        maps, field = joint_maps(
            frames,
            first,
            steps,
            fields,
            start=maps,
            unwrapped=unwrapped,
            labelled=known,
            held=np.arange(len(steps)) < held,
            params=params,
            top_level=top_level,
        )
        steps = field.steps_at(np.array([np.median(_centre(unwrapped))]))[:, 0]
        labelled = _labelled(maps, coarse, code, params)
    return _assembled(maps, labelled, _measured(maps, params), steps)


def _refuse_if_lost(known: BoolArray) -> None:
    if known.sum() < MIN_LABELLED:
        raise CaptureProblem(
            "tracking",
            "labelled_pixels",
            "The stripes could not be told apart on enough of the surface: turn the lever more slowly, and look "
            "that the stripes are sharp and bright on the object.",
            value=int(known.sum()),
            limit=MIN_LABELLED,
            unit="pixel",
        )


def _labelled(maps: FringeMaps, coarse: Float32Array, code: orders.RotationFit | None, params: PhaseParams) -> Labelled:
    """Orders by snakes and rotation code, carried on to where neither reaches."""
    measured = _measured(maps, params)
    snake = orders_from_coarse(maps.wrapped_phase, coarse, measured)
    found = Labelled(snake.order, snake.confidence)
    if code is not None:
        read = orders.search(code, _scanned(maps, params))
        votes, _ = orders.vote(snake.order, snake.confidence, read)
        found = Labelled(votes.order, votes.confidence, read.confident_share, votes.disagreement)
    grown = grow_orders(
        found.order, maps.wrapped_phase, measured, steps=params.growth_px, tolerance=params.growth_tolerance_rad
    )
    return found._replace(order=grown)


def _scanned(maps: FringeMaps, params: PhaseParams) -> Scanned:
    return Scanned(maps.wrapped_phase, maps.background, maps.modulation, _measured(maps, params))


def _measured(maps: FringeMaps, params: PhaseParams) -> BoolArray:
    noise = np.maximum(maps.residual_std, QUANTISATION)
    return maps.modulation > params.min_modulation_to_noise * noise


def _steps(snakes: ScanSnakes, first: int, last: int, height: int, held: int) -> FloatArray:
    """One step a frame, from the snakes of the field's middle, or of anywhere if none is there."""
    reference, reference_rows = snakes.identity[first], snakes.y[first]
    for rows in ((0.3 * height, 0.7 * height), None):
        parts = []
        for start in range(first, last + 1, SNAKE_BLOCK):
            part = slice(start, min(start + SNAKE_BLOCK, last + 1))
            parts.append(
                steps_from_snakes(
                    reference_identity=reference,
                    reference_y=reference_rows,
                    identity=snakes.identity[part],
                    y=snakes.y[part],
                    rows=rows,
                )
            )
        found = np.concatenate(parts)
        if np.isfinite(found[:held]).any() and np.isfinite(found[held:]).any():
            steps = fill_missing_steps(found)
            return steps - np.median(steps[:held])
    raise CaptureProblem(
        "tracking",
        "snakes",
        "The stripes were lost before or during the scan, so their motion is not known: turn lever and crank more "
        "slowly, and look that the stripes are sharp and bright on the object.",
        value=0,
        limit=1,
        unit="frame",
    )


def _centre(field: AnyArray) -> AnyArray:
    """The middle of a field (y, x)."""
    y, x = field.shape[0] // 2, field.shape[1] // 2
    return field[max(y - CENTRE, 0) : y + CENTRE, max(x - CENTRE, 0) : x + CENTRE]


def _assembled(maps: FringeMaps, labelled: Labelled, measured: BoolArray, steps: FloatArray) -> PhaseResult:
    has_order = labelled.order != UNKNOWN_ORDER
    expected = expected_noise(maps.background, maps.modulation, maps.residual_std)
    unwrapped = maps.wrapped_phase + TURN * labelled.order
    return PhaseResult(
        wrapped_phase=_where(maps.wrapped_phase, measured),
        unwrapped_phase=_where(unwrapped, has_order),
        fringe_order=np.where(has_order, labelled.order, UNKNOWN_ORDER).astype(np.int16),
        order_confidence=_where(labelled.confidence, has_order),
        background=maps.background,
        modulation=maps.modulation,
        phase_std=_where(maps.phase_std, measured),
        chi2=_where((maps.residual_std / expected) ** 2, measured),
        quality=_where(0.5 * len(steps) * maps.modulation, measured),
        steps=steps,
        labelled=labelled,
    )


def _where(values: AnyArray, known: BoolArray) -> Float32Array:
    return np.where(known, values, np.float32(np.nan)).astype(np.float32)
