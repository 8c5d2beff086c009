"""What a pixel sees while the slide turns (thesis B.1), and the fit of the slide's course to confident pixels.

| name | symbol | definition |
|---|---|---|
| first phase | Φ0 | phase at the first stop, turns, a polynomial over the image |
| last phase | Φ1 = φ/2π + m | phase at the second stop = reference slide position, turns; m the fringe order |
| shares | c_n, s_n | of the two in frame n: cos θ_n and sin θ_n for stops a right angle apart |
| piston | p_n | turns; ψ0·(1 − c_n − s_n) when Φ0 and Φ1 count from the same stripe, ψ0 the phase on the slide's axis |
| level | I_pn | g_n·(a_p + A_n·b_p·cos 2π(p_n + c_n·Φ0 + s_n·Φ1)) + o_n |
| signal | z_pn | ((I_pn − o_n)/g_n − a_p)/b_p |

c_n, s_n and p_n are free in each frame: stops that are not a right angle apart, play in the bearing, a first stop off
the epipolar lines and a tilted baseline (both add ε·Φ1 to Φ0, so s_n changes by ε·c_n) are all inside the model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, FloatArray

TURN = 2.0 * np.pi
SIGNAL_LIMIT = 1.6
"""Signals are cut here: beyond lie highlights and frames in which the pixel is not lit."""
_PRIOR_SHARE = 1e-3  # of the data's own information: how strongly Φ0 stays with the first hold
_SWING_LIMITS = (0.2, 1.5)
_GAIN_LIMITS = (0.5, 2.0)


class RotationPixels(NamedTuple):
    """Pixels of the rotation frames, and what the scan knows of them."""

    levels: AnyArray
    """(frame, pixel) grey levels as shot."""
    background: AnyArray
    """(pixel) a, grey levels."""
    modulation: AnyArray
    """(pixel) b, grey levels, above 0."""
    wrapped: AnyArray
    """(pixel) φ/2π, turns."""


class Course(NamedTuple):
    """The slide's course through the rotation, one value a frame."""

    piston: FloatArray
    """(frame) p_n, turns."""
    aligned: FloatArray
    """(frame) c_n, share of the first phase."""
    across: FloatArray
    """(frame) s_n, share of the last phase."""
    swing: FloatArray
    """(frame) A_n, modulation over that of the scan (motion blurs it)."""
    gain: FloatArray
    """(frame) g_n over that of the scan."""
    offset: FloatArray
    """(frame) o_n, grey levels."""


class Zero(NamedTuple):
    """Where the labels count from, once the course is known."""

    first_turns: int
    """To be added to Φ0 …"""
    last_turns: int
    """… and to Φ1, so that a stripe keeps its label from the first stop to the second."""
    axis_turns: float
    """ψ0, phase on the slide's axis, with the labels so counted."""
    residual_turns: float
    """Rms of the pistons off that model."""


def course_from_angles(
    angle_deg: FloatArray, *, gain: FloatArray, axis_turns: float = 0.0, first_turns: int = 0
) -> Course:
    """Start of the course from the slide angles (frame), 0 at the first stop and 90 at the second."""
    angle = np.deg2rad(angle_deg)
    aligned, across = np.cos(angle), np.sin(angle)
    piston = axis_turns * (1 - aligned - across) + first_turns * aligned
    return Course(piston, aligned, across, np.ones_like(angle), gain, np.zeros_like(angle))


def signal_of(pixels: RotationPixels, course: Course) -> FloatArray:
    """z (frame, pixel), cut at ±``SIGNAL_LIMIT``."""
    signal = (pixels.levels - course.offset[:, None]) / course.gain[:, None] - pixels.background
    return np.asarray(np.clip(signal / pixels.modulation, -SIGNAL_LIMIT, SIGNAL_LIMIT))


def course_off_angles(course: Course, angle_deg: FloatArray) -> float:
    """Rms distance of (c_n, s_n) to the turn that ``angle_deg`` (frame) says: 0.1 is 6°. A wrong fit is far off."""
    angle = np.deg2rad(angle_deg)
    return float(np.sqrt(np.mean((course.aligned - np.cos(angle)) ** 2 + (course.across - np.sin(angle)) ** 2)))


def refined_course(course: Course, pixels: RotationPixels, first: FloatArray, order: AnyArray) -> Course:
    """One Gauss–Newton step of each frame by itself, over pixels of known ``order`` (pixel).

    ``first`` is (pixel) Φ0 in turns.
    """
    last = pixels.wrapped + order
    cosine, sine = _cos_sin(course, first, last)
    off = signal_of(pixels, course) - course.swing[:, None] * cosine
    slope = -TURN * course.swing[:, None] * sine
    reflected = np.broadcast_to(pixels.background / pixels.modulation, off.shape)
    stray = np.broadcast_to(1.0 / pixels.modulation, off.shape)
    columns = np.stack([slope, slope * first, slope * last, cosine, reflected, stray], axis=1)
    weighted = columns * _robust(off)[:, None, :]
    normal = weighted @ columns.transpose(0, 2, 1)
    right = weighted @ off[..., None]
    scale = np.sqrt(np.diagonal(normal, axis1=1, axis2=2)) + 1e-12  # the columns have units of their own
    normal = normal / (scale[:, :, None] * scale[:, None, :]) + 1e-4 * np.eye(6)
    step = np.linalg.solve(normal, right / scale[..., None])[..., 0] / scale
    return Course(
        piston=course.piston + step[:, 0],
        aligned=course.aligned + step[:, 1],
        across=course.across + step[:, 2],
        swing=np.clip(course.swing + step[:, 3], *_SWING_LIMITS),
        gain=np.clip(course.gain * (1.0 + step[:, 4]), *_GAIN_LIMITS),
        offset=course.offset + course.gain * step[:, 5],
    )


def refined_first_phase(
    coefficients: FloatArray,
    start: FloatArray,
    course: Course,
    pixels: RotationPixels,
    terms: FloatArray,
    order: AnyArray,
) -> FloatArray:
    """One Gauss–Newton step of the polynomial of Φ0 (term), held near that of the first hold (``start``).

    ``terms`` is (term, pixel).
    """
    cosine, sine = _cos_sin(course, coefficients @ terms, pixels.wrapped + order)
    off = signal_of(pixels, course) - course.swing[:, None] * cosine
    slope = -TURN * (course.swing * course.aligned)[:, None] * sine
    weighted = _robust(off) * slope
    normal = (terms * (weighted * slope).sum(0)) @ terms.T
    prior = _PRIOR_SHARE * np.trace(normal) / len(normal) * np.eye(len(normal))
    right = terms @ (weighted * off).sum(0) + prior @ (start - coefficients)
    return np.asarray(coefficients + np.linalg.solve(normal + prior, right))


def zero_of_course(course: Course) -> Zero:
    """Integers that make the pistons ψ0·(1 − c_n − s_n): then Φ0 and Φ1 name a stripe alike.

    The share of Φ1 at the first stop (ε, see above) is taken off the shares of all frames first.
    """
    near = course.aligned > 0.97
    ideal = np.sqrt(np.clip(1 - course.aligned**2, 0, 1))
    lean = float(np.median((course.across - ideal)[near])) if near.any() else 0.0
    across = course.across - lean * course.aligned
    columns = np.stack([1 - course.aligned - across, course.aligned, across], axis=-1)
    found = np.linalg.lstsq(columns, course.piston, rcond=None)[0]
    integers = np.rint(found[1:])
    rest = course.piston - columns[:, 1:] @ integers
    axis = float(columns[:, 0] @ rest / max(columns[:, 0] @ columns[:, 0], 1e-9))
    residual = float(np.sqrt(np.mean((rest - axis * columns[:, 0]) ** 2)))
    return Zero(int(integers[0]), int(integers[1]), axis, residual)


def _cos_sin(course: Course, first: FloatArray, last: FloatArray) -> tuple[FloatArray, FloatArray]:
    turns = course.piston[:, None] + np.outer(course.aligned, first) + np.outer(course.across, last)
    return np.cos(TURN * turns), np.sin(TURN * turns)


def _robust(off: FloatArray) -> FloatArray:
    """Cauchy weights: shadows, highlights and wrong orders count little."""
    scale = 1.4826 * np.median(np.abs(off), axis=1, keepdims=True) + 1e-3
    return np.asarray(1.0 / (1.0 + (off / (2.5 * scale)) ** 2))
