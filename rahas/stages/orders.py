"""Rotation frames and the scan's wrapped phase → fringe order of each pixel by itself, and the vote with the snakes.

fit (once a capture, a rough phase will do) → search (again when the phase is better) → vote.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.first_hold_phase import EXPONENTS, polynomial_terms
from rahas.kernels.order_search import search_orders
from rahas.kernels.order_vote import Votes, label_offset, voted_orders
from rahas.kernels.rotation_code import (
    CONFIDENT,
    FEWEST_PIXELS,
    RotationCode,
    blind_start,
    order_candidates,
    solve_rotation_code,
)
from rahas.kernels.rotation_model import Course, course_off_angles, zero_of_course
from rahas.kernels.sampling import evenly_spread
from rahas.kernels.unwrapping import UNKNOWN_ORDER
from rahas.stages.rotation_frames import (
    FEWEST_FRAMES,
    Rotation,
    Scanned,
    Shots,
    chosen_frames,
    first_phase_of_frames,
)
from rahas.typing import AnyArray, Float32Array, FloatArray, FrameStack

FIT_PIXELS = 2500
MIN_CONFIDENT_SHARE = 0.3
"""Fewer confident pixels than this in the fit: the course was not found, nothing is said."""
MAX_OFF_ANGLES = 0.15
"""A course this far (9°) from the timeline's slide angles is no turn of the slide."""
_BAND_PIXELS = 32768


class RotationFit(NamedTuple):
    """The slide's course, and the frames it was found in."""

    shots: Shots
    """The rotation frames used."""
    fields: list[slice]
    codes: list[RotationCode]
    """Of each field; empty: the course was not found, and nothing is said."""
    first_turns: int
    """Added to Φ0 and …"""
    last_turns: int
    """… to the orders found, so that a stripe keeps its label from the first stop to the second."""
    zero_residual_turns: float
    """How well the labels of both stops belong together; above 0.1 they may be off by one as a whole."""
    confident_share: float
    """Of the pixels in the fit, 0 … 1."""


class CodeOrders(NamedTuple):
    """Fringe orders from the rotation alone."""

    order: AnyArray
    """(y, x) int16, −32768 where not measured; labels count from the slide's axis."""
    confidence: Float32Array
    """(y, x) 0 … 1, by how much the best order fits better than the second best."""
    first_phase: FloatArray | None
    """(term) Φ0 in turns with the same labels; None: the course was not found."""
    confident_share: float
    """Of the measured pixels, 0 … 1."""


def fit(frames: FrameStack, rotation: Rotation, *, fields: list[slice], scanned: Scanned) -> RotationFit:
    """Find the slide's course from the rotation frames themselves: nothing of the rig is known.

    Parameters
    ----------
    frames
        (frame, y, x), luma.
    fields
        Rows of each field in temporal order: one slice for progressive frames.
    """
    numbers = chosen_frames(frames, rotation)
    nothing = RotationFit(Shots(frames, numbers[:0]), fields, [], 0, 0, np.inf, 0.0)
    fewest = min(np.count_nonzero(scanned.measured[rows]) for rows in fields)
    if len(numbers) < FEWEST_FRAMES or fewest < FEWEST_PIXELS:
        return nothing
    try:
        first_phase = first_phase_of_frames(frames, rotation, fields[0], scanned)
    except ValueError:
        return nothing
    shots, angle = Shots(frames, numbers), rotation.slide_angle_deg[numbers]
    codes: list[RotationCode] = []
    for number, rows in enumerate(fields):
        former = codes[0] if codes else None
        later = numbers + number / len(fields)
        code = _fitted(shots, rows, scanned, angle, first_phase, former, later)
        share = code.confident_share
        off = course_off_angles(code.course, angle)
        if share < MIN_CONFIDENT_SHARE or off > MAX_OFF_ANGLES:
            return nothing._replace(confident_share=share)
        codes.append(code)
    zero = zero_of_course(codes[0].course)
    return RotationFit(
        shots, fields, codes, zero.first_turns, zero.last_turns, zero.residual_turns, codes[0].confident_share
    )


def search(fitted: RotationFit, scanned: Scanned) -> CodeOrders:
    """Order of every measured pixel by itself: no neighbours, no tracking."""
    shape = scanned.measured.shape
    order, confidence = np.full(shape, UNKNOWN_ORDER, np.int16), np.zeros(shape, np.float32)
    if not fitted.codes:
        return CodeOrders(order, confidence, None, 0.0)
    size = max(1, _BAND_PIXELS // shape[1])
    for band in fitted.shots.bands():
        shots = fitted.shots.rows(band)
        for code, rows in zip(fitted.codes, fitted.fields, strict=True):
            image_rows = np.arange(shape[0])[rows]
            own_rows = image_rows[(image_rows >= band.start) & (image_rows < band.stop)]
            for begin in range(0, len(own_rows), size):
                here = own_rows[begin : begin + size]
                y, x = np.nonzero(scanned.measured[here])
                if not len(y):
                    continue
                at = (here[y], x)
                found = search_orders(
                    scanned.pixels(shots[:, at[0] - band.start, at[1]], at),
                    first=code.first_phase @ polynomial_terms(*at, shape),
                    course=code.course,
                    candidates=code.candidates,
                )
                order[at] = found.order + fitted.last_turns
                confidence[at] = found.confidence
    share = float(np.mean(confidence[scanned.measured] > CONFIDENT))
    return CodeOrders(order, confidence, _raised(fitted.codes[0].first_phase, fitted.first_turns), share)


def vote(
    snake_order: AnyArray, snake_confidence: AnyArray, code: CodeOrders, *, offset: int | None = None
) -> tuple[Votes, FloatArray | None]:
    """Fuse the two, in the snakes' labels; also Φ0 in those labels (term), for scans that use this as calibration.

    Parameters
    ----------
    snake_order, snake_confidence
        (y, x), −32768 where unknown; may be unknown everywhere.
    offset
        What to add to the code's orders, as from :func:`offset_to_calibration`; None: by majority with the snakes,
        0 if there are none.
    """
    if offset is None:
        offset = label_offset(snake_order, code.order, code.confidence >= CONFIDENT) or 0
    votes = voted_orders(snake_order, snake_confidence, code.order, code.confidence, offset=offset)
    return votes, None if code.first_phase is None else _raised(code.first_phase, offset)


def offset_to_calibration(own: FloatArray, calibration: FloatArray) -> tuple[int, float]:
    """Integer to add to a scan's code orders for its calibration's labels, and what is left over, turns.

    In the first hold the stripes lie where they lay in the calibration, whatever the surface: the two Φ0 (term), each
    in its own labels, differ by the integer sought. More than 0.1 left over: the slide or the rig has moved between (a
    first stop 2° off the epipolar lines leaves some hundredths, as depth then moves the stripes of the first hold).
    """
    place = np.linspace(0, 100, 21)
    terms = polynomial_terms(place[:, None], place[None, :], (101, 101)).reshape(len(EXPONENTS), -1)
    difference = (calibration - own) @ terms
    offset = int(np.rint(np.median(difference)))
    return offset, float(np.median(np.abs(difference - offset)))


def _raised(first_phase: FloatArray, turns: int) -> FloatArray:
    raised = first_phase.copy()
    raised[0] += turns
    return raised


def _fitted(
    shots: Shots,
    rows: slice,
    scanned: Scanned,
    angle_deg: FloatArray,
    first_phase: FloatArray,
    former: RotationCode | None,
    later: FloatArray,
) -> RotationCode:
    """Course of one field, from some thousands of its pixels; a later field starts from the first one's course."""
    shape = scanned.measured.shape
    y, x = evenly_spread(scanned.measured[rows], FIT_PIXELS)
    at = (np.arange(shape[0])[rows][y], x)
    pixels = scanned.pixels(shots.pixels(*at).astype(float), at)
    terms = polynomial_terms(*at, shape)
    if former is not None:
        start = Course(*(np.interp(later, shots.numbers, values) for values in former.course))
        return solve_rotation_code(
            pixels, start, terms=terms, first_phase=former.first_phase, candidates=former.candidates
        )
    across = 2.0 * abs(float(first_phase[EXPONENTS.index((1, 0))]))
    candidates = order_candidates(stripes_down=across * shape[0] / shape[1])
    start = blind_start(
        pixels,
        angle_deg=angle_deg,
        gain=pixels.levels.mean(axis=1) / pixels.background.mean(),
        first=first_phase @ terms,
        candidates=candidates,
        stripes_across=across,
    )
    return solve_rotation_code(pixels, start, terms=terms, first_phase=first_phase, candidates=candidates)
