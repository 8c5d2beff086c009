"""Which stripe lies where, predicted for each point of the object by itself.

A snake that follows its column on the canvas meets a depth step as the object turns under it, and may take the next
stripe's continuation for its own. A point of the object never moves in the image: with A the pattern's phase at
epipolar alignment and B its phase at phase alignment, both counted in stripes,

    K_n(p) = A(p)·cos θ_n + B(p)·sin θ_n + (a_n + b_n·x + c_n·y)

is the identity (with fraction) of the stripe at p in frame n (thesis B.1). A is smooth whatever the surface, known from
the first labels. B holds the surface: it starts as a plane and is learned, cell by cell and without any neighbour,
by recursive least squares on what the cell shows. The plane of each frame takes up errors of the slide angle, the
slide's centre and the crank's motion. Snakes that contradict the prediction where it is sure lose their names.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.peaks import Peaks
from rahas.kernels.snake_light import LEVEL_OFFSET
from rahas.kernels.unrotation import image_matrix
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray

_BLOCKS = 4
_FORGETTING = 0.97
_PRIOR_INFORMATION = 0.5
_MEMORY = 0.9
_PLANE_CLOSE = 0.02
MIN_AGREEMENT = 0.6
"""Correlation of what a cell shows with what it should show, above which its prediction is sure."""
_MAX_FRACTION = 0.3


class Prediction(NamedTuple):
    """State after a frame, on a grid of cells of the image."""

    cell_px: int
    """Distance of cells; cell (i, j) is pixel (i·cell_px, j·cell_px)."""
    aligned: Float32Array
    """(i, j) A, stripes."""
    across: Float32Array
    """(i, j) B, stripes."""
    information: Float32Array
    """(i, j) of the least-squares estimate of B."""
    plane: FloatArray
    """(3) a_n, b_n, c_n of the last frame, over x and y from −0.5 to 0.5."""
    shown: Float32Array
    """(i, j) running mean of (pattern · predicted pattern)."""
    expected: Float32Array
    """(i, j) running mean of (predicted pattern)²."""
    stripe: Float32Array
    """(i, j) K of the last frame, stripes."""

    @property
    def sure(self) -> BoolArray:
        """(i, j) where the cell shows what it should."""
        agreed: BoolArray = self.shown > MIN_AGREEMENT * self.expected
        return agreed


def first_prediction(aligned: FloatArray, *, cell_px: int, pitch_px: float) -> Prediction:
    """State before the rotation, from the stripe numbers ``aligned`` (i, j) of the first frame."""
    a = aligned.astype(np.float32)
    rows = (np.arange(a.shape[0], dtype=np.float32) - np.float32(0.5 * (a.shape[0] - 1)))[:, None]
    return Prediction(
        cell_px=cell_px,
        aligned=a,
        across=np.broadcast_to(rows * np.float32(cell_px / pitch_px), a.shape).copy(),
        information=np.full(a.shape, _PRIOR_INFORMATION, np.float32),
        plane=np.zeros(3),
        shown=np.zeros(a.shape, np.float32),
        expected=np.full(a.shape, 1e-6, np.float32),
        stripe=a.copy(),
    )


def predicted(state: Prediction, levels: Float32Array, *, slide_angle_deg: float) -> Prediction:
    """State after a frame's pattern ``levels`` (y, x; cos ψ + ``LEVEL_OFFSET``, 0 unlit) at this slide angle."""
    seen_level = levels[:: state.cell_px, :: state.cell_px]
    lit = seen_level > 0
    pattern = np.where(lit, seen_level - np.float32(LEVEL_OFFSET), np.float32(0))
    cos, sin = np.float32(np.cos(np.deg2rad(slide_angle_deg))), np.float32(np.sin(np.deg2rad(slide_angle_deg)))
    base = state.aligned * cos + state.across * sin
    plane = state.plane
    stripe, in_phase, quadrature = _with_plane(base, plane)
    for _ in range(2):
        off = _plane_of_blocks(pattern * in_phase, -pattern * quadrature)
        plane = plane + off
        stripe, in_phase, quadrature = _with_plane(base, plane)
        if np.abs(off).max() < _PLANE_CLOSE:
            break
    slope = np.where(lit, np.float32(-2 * np.pi) * sin * quadrature, np.float32(0))
    information = state.information * np.float32(_FORGETTING) + slope * slope
    np.maximum(information, np.float32(_PRIOR_INFORMATION), out=information)
    change = slope * (pattern - in_phase) / information
    np.clip(change, -0.15, 0.15, out=change)
    kept = np.float32(_MEMORY)
    return state._replace(
        across=state.across + change,
        information=information,
        plane=plane,
        shown=np.where(lit, kept * state.shown + (1 - kept) * pattern * in_phase, state.shown),
        expected=np.where(lit, kept * state.expected + (1 - kept) * in_phase * in_phase, state.expected),
        stripe=stripe + sin * change,
    )


def predicted_names(state: Prediction, peaks: Peaks, *, unrotation_deg: float, height: int, width: int) -> AnyArray:
    """Names (x, slot) int16 of this frame's peaks where the prediction is sure; ``NO_NAME`` elsewhere.

    Names below 1 belong to stripes above the topmost one of the first frame.
    """
    x, slot = np.nonzero(np.arange(peaks.y.shape[1]) < peaks.counts[:, None])
    y = peaks.y[x, slot]
    matrix = image_matrix(unrotation_deg, height=height, width=width) / state.cell_px
    j = np.rint(matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]).astype(np.int64)
    i = np.rint(matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]).astype(np.int64)
    np.clip(i, 0, state.stripe.shape[0] - 1, out=i)
    np.clip(j, 0, state.stripe.shape[1] - 1, out=j)
    stripe = state.stripe[i, j]
    name = np.clip(np.rint(stripe), -999, 999)  # far from all labels the cubic may be anything
    sure = state.sure[i, j] & (np.abs(stripe - name) < _MAX_FRACTION)
    names = np.full(peaks.y.shape, NO_NAME, np.int16)
    names[x, slot] = np.where(sure, name, NO_NAME)
    return names


NO_NAME = -32768


def without_contradicted(names: AnyArray, expected: AnyArray) -> AnyArray:
    """Names (x, slot) with those set to 0 that differ from an expected name."""
    out: AnyArray = np.where((expected != NO_NAME) & (expected != names), 0, names).astype(np.int16)
    return out


def agreement(names: AnyArray, expected: AnyArray) -> float:
    """Share of the named peaks that have the name expected of them, of those of which one is expected."""
    both = (names > 0) & (expected != NO_NAME)
    return float(np.mean(names[both] == expected[both])) if both.any() else 1.0


def _with_plane(base: Float32Array, plane: FloatArray) -> tuple[Float32Array, Float32Array, Float32Array]:
    """K, cos 2πK and sin 2πK."""
    stripe = base + _plane_map(plane, base.shape)
    turn = stripe * np.float32(2 * np.pi)
    return stripe, np.cos(turn), np.sin(turn)


def _plane_map(plane: FloatArray, shape: tuple[int, ...]) -> Float32Array:
    y = np.linspace(-0.5, 0.5, shape[0], dtype=np.float32)[:, None]
    x = np.linspace(-0.5, 0.5, shape[1], dtype=np.float32)
    out: Float32Array = (np.float32(plane[0]) + np.float32(plane[2]) * y) + np.float32(plane[1]) * x
    return out


def _plane_of_blocks(real: Float32Array, imaginary: Float32Array) -> FloatArray:
    """Plane through the phase offsets of blocks of the image, stripes; a block weighs as much as its phasor."""
    rows, columns = (np.linspace(0, n, _BLOCKS + 1).astype(int)[:-1] for n in real.shape)
    phasor = np.add.reduceat(np.add.reduceat(real, rows, axis=0), columns, axis=1).astype(np.complex128)
    phasor += 1j * np.add.reduceat(np.add.reduceat(imaginary, rows, axis=0), columns, axis=1)
    whole = phasor.sum()
    offset = float(np.angle(whole)) / (2 * np.pi)
    rest = np.angle(phasor * np.exp(-1j * np.angle(whole))) / (2 * np.pi)
    middle = (np.arange(_BLOCKS) + 0.5) / _BLOCKS - 0.5
    terms = np.stack([np.ones((_BLOCKS, _BLOCKS)), *np.meshgrid(middle, middle)]).reshape(3, -1)
    weight = np.abs(phasor).ravel()
    weight = weight / max(float(weight.sum()), 1e-12)
    normal = (terms * weight) @ terms.T + 1e-3 * np.diag([0.0, 1.0, 1.0]) + 1e-12 * np.eye(3)
    plane: FloatArray = np.linalg.solve(normal, (terms * weight) @ rest.ravel())
    plane[0] += offset
    return plane
