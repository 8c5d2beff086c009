"""Snakes, rotation and scan frames → wrapped phase, fringe order and unwrapped phase (thesis 3.5, appendix B)."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.phase_field import noise_of_light
from rahas.kernels.phase_shifting import TURN, FringeMaps
from rahas.kernels.resolution import image_scale
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
from rahas.stages.phase_maps import joint_maps, joint_steps, linear_maps, sampled
from rahas.stages.rotation_frames import Rotation, Scanned
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

QUANTISATION = 0.3  # grey levels: standard deviation of rounding
MIN_LABELLED = 500  # pixels
SNAKE_BLOCK = 64  # frames, where the store does not say how many it keeps together
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
    compression_cost: float | None  # factor in phase_std for errors that last over frames; None: not measured


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
    cost: float | None = None
    code: orders.RotationFit | None = None
    if rotation is not None:
        code = orders.fit(frames, rotation, fields=fields, scanned=_scanned(maps, params))
    labelled = _labelled(maps, coarse, code, params)
    if params.method == "joint":
        known = labelled.order != UNKNOWN_ORDER
        _refuse_if_lost(known)
        unwrapped = with_smooth_guess(_unwrapped(maps.wrapped_phase, labelled.order), known)
        samples = sampled(frames, first, steps, fields, start=maps, labelled=known, params=params, top_level=top_level)
        del maps, labelled  # as much memory as the maps that follow
        solved = joint_steps(samples, unwrapped, held=np.arange(len(steps)) < held)
        maps, cost = joint_maps(solved, unwrapped, top_level=top_level)
        steps = solved[0].steps.steps_at(np.array([np.median(_centre(unwrapped))]))[:, 0]
        del unwrapped, samples, solved
        labelled = _labelled(maps, coarse, code, params)
    del coarse, code
    return _assembled(maps, labelled, _measured(maps, params), steps, cost)


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
    found = Labelled(*orders_from_coarse(maps.wrapped_phase, coarse, measured))
    if code is not None:
        read = orders.search(code, _scanned(maps, params))
        votes, _ = orders.vote(found.order, found.confidence, read)
        found = Labelled(votes.order, votes.confidence, read.confident_share, votes.disagreement)
        del read, votes
    reach = round(params.growth_px * image_scale(*measured.shape))
    grown = grow_orders(found.order, maps.wrapped_phase, measured, steps=reach, tolerance=params.growth_tolerance_rad)
    return found._replace(order=grown)


def _scanned(maps: FringeMaps, params: PhaseParams) -> Scanned:
    return Scanned(maps.wrapped_phase, maps.background, maps.modulation, _measured(maps, params))


def _measured(maps: FringeMaps, params: PhaseParams) -> BoolArray:
    noise = np.maximum(maps.residual_std, QUANTISATION)
    return maps.modulation > params.min_modulation_to_noise * noise


def _steps(snakes: ScanSnakes, first: int, last: int, height: int, held: int) -> FloatArray:
    """One step a frame, from the snakes of the field's middle, or of anywhere if none is there."""
    reference, reference_rows = snakes.identity[first], snakes.y[first]
    size = getattr(snakes.y, "chunks", (SNAKE_BLOCK,))[0]
    borders = [first, *range((first // size + 1) * size, last + 1, size), last + 1]
    for rows in ((0.3 * height, 0.7 * height), None):
        parts = [
            steps_from_snakes(
                reference_identity=reference,
                reference_y=reference_rows,
                identity=snakes.identity[start:stop],
                y=snakes.y[start:stop],
                rows=rows,
            )
            for start, stop in pairwise(borders)
        ]
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


def _unwrapped(wrapped: Float32Array, order: AnyArray) -> Float32Array:
    """Φ = φ + 2π·order, summed in double precision, row by row."""
    out = np.empty_like(wrapped)
    for target, phase, turns in zip(out, wrapped, order, strict=True):
        target[:] = phase + TURN * turns
    return out


def _assembled(
    maps: FringeMaps, labelled: Labelled, measured: BoolArray, steps: FloatArray, cost: float | None = None
) -> PhaseResult:
    """The result; it takes the maps' own memory."""
    expected = noise_of_light(maps.background, maps.modulation, maps.residual_std).at(maps.background)
    chi2 = np.square(np.divide(maps.residual_std, expected, out=maps.residual_std), out=maps.residual_std)
    del expected
    has_order = labelled.order != UNKNOWN_ORDER
    unwrapped = _unwrapped(maps.wrapped_phase, labelled.order)
    quality = np.float32(0.5 * len(steps)) * maps.modulation
    blank = np.float32(np.nan)
    for values, known in (
        (maps.wrapped_phase, measured),
        (unwrapped, has_order),
        (labelled.confidence, has_order),
        (maps.phase_std, measured),
        (chi2, measured),
        (quality, measured),
    ):
        np.copyto(values, blank, where=~known)
    return PhaseResult(
        wrapped_phase=maps.wrapped_phase,
        unwrapped_phase=unwrapped,
        fringe_order=labelled.order,
        order_confidence=labelled.confidence,
        background=maps.background,
        modulation=maps.modulation,
        phase_std=maps.phase_std,
        chi2=chi2,
        quality=quality,
        steps=steps,
        labelled=labelled,
        compression_cost=cost,
    )
