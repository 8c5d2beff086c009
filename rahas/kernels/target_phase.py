"""The projector fitted on the dense phase of the roof's two slopes, instead of on 18 dark marks only."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.camera import Camera
from rahas.kernels.projector import ProjectorFit, fit_projector
from rahas.kernels.projector_lens import NO_LENS, Lens, phase_through_lens
from rahas.kernels.roof import Roof, near_marks, points_on_roof, within_marks
from rahas.kernels.triangulation import pixel_grid
from rahas.typing import AnyArray, BoolArray, FloatArray

_GATE = 4.0
_MIN_GATE_RAD = 0.02
_MAX_POINTS = 20000


class TargetPhaseFit(NamedTuple):
    """The projector and the points that it rests on."""

    fit: ProjectorFit
    pixels: FloatArray
    """(n, 2) px."""
    points: FloatArray
    """(n, 3) mm on the slopes."""
    inlier_share: float
    """Share of the measured pixels between the marks that agree with the two planes."""


def fit_projector_on_roof(
    unwrapped_phase: AnyArray,
    camera: Camera,
    roof: Roof,
    marks: FloatArray,
    *,
    mark_radius_mm: float,
    margin_mm: float,
    start: FloatArray | None,
    lens: Lens = NO_LENS,
) -> TargetPhaseFit:
    """Fit the projector between the marks, then on all that agrees with the two planes and hangs together with them.

    ``marks`` (m, 3) all marks of the table; ``start`` (2, 4) the projector of the marks' own phases; ``lens`` is taken
    as known. Around the marks and along the ridge, where a pixel mixes two phases, nothing is used.

    Raises
    ------
    ValueError
        Too little phase is measured between the marks.
    """
    height, width = unwrapped_phase.shape
    step = max(1, int(np.ceil(np.sqrt(height * width / _MAX_POINTS))))
    grid = pixel_grid(height, width, step=step)
    value = np.asarray(unwrapped_phase[::step, ::step], dtype=np.float64)
    shape = value.shape
    points, from_ridge = points_on_roof(camera, roof, grid.reshape(-1, 2))
    pitch = float(np.median(np.linalg.norm(np.diff(points.reshape(*shape, 3), axis=1), axis=-1))) / step
    clear = np.isfinite(value.ravel()) & (from_ridge > 3.0 * pitch)
    clear &= ~near_marks(points, marks, radius_mm=mark_radius_mm + 3.0 * pitch)
    inner = clear & within_marks(points, marks, margin_mm=margin_mm)
    if inner.sum() < 100:
        raise ValueError(f"{int(inner.sum())} points with phase between the marks, 100 are needed")
    fit = fit_projector(points[inner], value.ravel()[inner], start=start, gate=_GATE, lens=lens)
    share = float(fit.used.mean())
    used = inner.copy()
    used[inner] = fit.used
    for _ in range(2):
        residual = np.full(value.size, np.inf)
        residual[clear] = value.ravel()[clear] - phase_through_lens(fit.matrix, lens, points[clear])
        limit = max(_GATE * fit.sigma_rad, _MIN_GATE_RAD)
        used = _joined(np.reshape(np.abs(residual) < limit, shape), np.reshape(inner, shape)).ravel()
        if used.sum() < 100:
            break
        fit = fit_projector(points[used], value.ravel()[used], start=fit.matrix, gate=_GATE, lens=lens)
    flat = grid.reshape(-1, 2)
    return TargetPhaseFit(fit, flat[used], points[used], share)


def _joined(agreeing: BoolArray, seed: BoolArray) -> BoolArray:
    """Parts of ``agreeing`` that hang together with ``seed``, thin lines (chance agreement) left out."""
    solid = cv2.morphologyEx(agreeing.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(solid | (agreeing & seed).astype(np.uint8), connectivity=8)
    counts = np.bincount(labels[seed & agreeing], minlength=int(labels.max()) + 1)
    counts[0] = 0
    wanted = counts > 0.05 * max(int(counts.sum()), 1)
    joined: BoolArray = wanted[labels] & agreeing
    return joined
