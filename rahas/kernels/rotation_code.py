"""The rotation as a code: blind fit of the slide's course, in turn with the orders of some thousands of pixels.

Start: slide angles good to some 2°, Φ0 from the first hold, φ from the scan. Unknown are the stripe that runs through
the slide's axis (an integer of Φ0) and the phase ψ0 there: all are tried, the best mean correlation is unique. Then
in turn the best order of each pixel, and Gauss–Newton on the course and on Φ0 over those that are confident.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.order_search import OrderSearch, candidate_table, search_orders
from rahas.kernels.rotation_model import (
    TURN,
    Course,
    RotationPixels,
    course_from_angles,
    refined_course,
    refined_first_phase,
    signal_of,
)
from rahas.typing import AnyArray, FloatArray

CONFIDENT = 0.2
"""Confidence of the search above which an order is believed."""
FEWEST_PIXELS = 100
_SEARCH_PIXELS = 500
_AXIS_PHASES = 8
_MARGIN = 6  # stripes
_ROUNDS = 6
_STEPS_A_ROUND = 2
_SETTLED = 2e-3  # share of pixels whose order still changes


class RotationCode(NamedTuple):
    """The slide's course, as the confident pixels saw it."""

    course: Course
    first_phase: FloatArray
    """(term) polynomial of Φ0, turns."""
    candidates: AnyArray
    """Orders among which pixels are to be sought: consecutive integers."""
    search: OrderSearch
    """Of the pixels that took part."""
    confident_share: float
    """Of the pixels that took part."""


def solve_rotation_code(
    pixels: RotationPixels,
    start: Course,
    *,
    terms: FloatArray,
    first_phase: FloatArray,
    candidates: AnyArray,
) -> RotationCode:
    """Fit the rotation to some thousands of lit pixels, spread over the image.

    Parameters
    ----------
    start
        Course from the blind start, or of the other field.
    terms
        (term, pixel) of the polynomial of Φ0.
    first_phase
        (term) Φ0 as the first hold shows it, turns.
    candidates
        Orders to choose from, consecutive integers.

    Raises
    ------
    ValueError
        Too few pixels.
    """
    if pixels.levels.shape[1] < FEWEST_PIXELS:
        raise ValueError(f"{pixels.levels.shape[1] = } pixels in the rotation, expected at least {FEWEST_PIXELS}")
    course, coefficients = start, first_phase
    found = search_orders(pixels, first=coefficients @ terms, course=course, candidates=candidates)
    for _ in range(_ROUNDS):
        limit = min(CONFIDENT, float(np.quantile(found.confidence, 0.5)))
        sure = np.flatnonzero(found.confidence >= limit)
        own = RotationPixels(pixels.levels[:, sure], *(a[sure] for a in pixels[1:]))
        for _ in range(_STEPS_A_ROUND):
            course = refined_course(course, own, coefficients @ terms[:, sure], found.order[sure])
            coefficients = refined_first_phase(
                coefficients, first_phase, course, own, terms[:, sure], found.order[sure]
            )
        former, found = (
            found,
            search_orders(pixels, first=coefficients @ terms, course=course, candidates=candidates),
        )
        if np.mean(found.order != former.order) < _SETTLED:
            break
    return RotationCode(course, coefficients, candidates, found, float(np.mean(found.confidence > CONFIDENT)))


def order_candidates(*, stripes_down: float) -> AnyArray:
    """Orders to try, counted from the slide's axis: it lies in the image or a little outside."""
    reach = int(np.ceil(stripes_down)) + _MARGIN
    return np.arange(-reach, reach + 1)


def blind_start(
    pixels: RotationPixels,
    *,
    angle_deg: FloatArray,
    gain: FloatArray,
    first: FloatArray,
    candidates: AnyArray,
    stripes_across: float,
) -> Course:
    """Try every stripe and eight phases at the slide's axis: the course of best mean correlation.

    Parameters
    ----------
    angle_deg
        (frame) rough slide angle, 0 at the first stop, 90 at the second.
    gain
        (frame) brightness over the scan's.
    first
        (pixel) Φ0, turns, of any integer.
    stripes_across
        About how many stripes the image is wide.
    """
    plain = course_from_angles(angle_deg, gain=gain)
    count = pixels.levels.shape[1]
    some = np.linspace(0, count - 1, min(_SEARCH_PIXELS, count)).astype(int)
    own = RotationPixels(pixels.levels[:, some], *(a[some] for a in pixels[1:]))
    signal = signal_of(own, plain)
    turns = TURN * (np.outer(plain.aligned, first[some]) + np.outer(plain.across, own.wrapped))
    # z·e^{iβ} of the plain course; a piston turns it
    turned = (signal * np.exp(1j * turns)).astype(np.complex64)
    table = candidate_table(plain, candidates)[:, : 2 * len(turned)]
    middle, reach = int(np.rint(np.median(first))), int(np.ceil(0.75 * stripes_across)) + 2
    best, course = -np.inf, plain
    for first_turns in range(-middle - reach, -middle + reach + 1):
        for phase in range(_AXIS_PHASES):
            tried = course_from_angles(angle_deg, gain=gain, axis_turns=phase / _AXIS_PHASES, first_turns=first_turns)
            here = turned * np.exp(1j * TURN * tried.piston).astype(np.complex64)[:, None]
            score = float((table @ np.concatenate([here.real, here.imag])).max(axis=0).mean())
            if score > best:
                best, course = score, tried
    return course
