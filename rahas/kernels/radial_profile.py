"""Radial distortion of camera and projector from marks and dense phase together.

Eighteen marks in the middle of the image tell little about the lens at its corners. The phase on the roof's two planes
reaches further: only with the right k1 of both lenses is it what a projector shows at the points that the camera names.
The camera's matrix stays the marks' own, the projector's matrix the dense phase's; the two k1 alone are moved, along
the profile of both misfits. A k1 is kept only if leaving it out costs more than ``significance``² of χ².
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import CameraFit, fit_camera_with_radial
from rahas.kernels.projector import fit_projector
from rahas.kernels.projector_lens import NO_LENS, Lens, squared_tangent
from rahas.kernels.roof import Roof, points_on_roof
from rahas.typing import FloatArray, IntArray

_EFFECTIVE_POINTS = 400.0  # the phase's errors hang together over many pixels: it never counts as more points than that
_FINEST_MARK_PX = 0.01
_FINEST_PHASE_RAD = 0.001
_STEP_SHARE = 0.002
_POINTS = 4000
_ROUNDS = 3
ALIKE = 0.8  # correlation of the two k1
DOUBTFUL = 2.0  # standard deviations: less is clearly 0


class LensFits(NamedTuple):
    """Both lenses."""

    camera: CameraFit
    """With its k1, 0 where it is not kept; k1's own variance is in the covariance."""
    projector_radial: float
    """k1, 0 where it is not kept."""
    covariance: FloatArray
    """(2, 2) of the camera's and the projector's k1; 0 where not kept."""


def fit_radial(
    world: FloatArray,
    marks_px: FloatArray,
    roof: Roof,
    pixels: FloatArray,
    unwrapped_phase: FloatArray,
    projector: FloatArray,
    *,
    centre: FloatArray,
    start: float,
    significance: float,
    projector_lens: Lens | None = None,
) -> LensFits:
    """Camera of the marks ``world`` (n, 3), ``marks_px`` (n, 2) with the k1 of both lenses that suit marks and phase.

    ``pixels`` (m, 2), ``unwrapped_phase`` (m,) on the roof. ``projector_lens`` tells the projector's centre and where
    its k1 begins; ``None``: that lens is taken as ideal.
    """
    some = slice(None, None, max(1, len(pixels) // _POINTS))
    pixels, unwrapped_phase = pixels[some], unwrapped_phase[some]
    lens = projector_lens or NO_LENS
    # both k1 are counted in units that move the farthest point by _STEP_SHARE of its distance
    unit = np.array([_STEP_SHARE / float(np.max(np.sum((pixels - centre) ** 2, axis=1))), 0.0])
    if projector_lens is not None:
        points, _ = points_on_roof(
            fit_camera_with_radial(world, marks_px, centre=centre, radial=start).camera, roof, pixels
        )
        unit[1] = _STEP_SHARE / float(np.max(squared_tangent(projector, lens.centre, points)))
    free = np.flatnonzero(unit)

    def misfit(counts: FloatArray) -> FloatArray:
        """Squared residuals of the marks, px², and of the phase, rad² a point."""
        radial = counts * unit
        fit = fit_camera_with_radial(world, marks_px, centre=centre, radial=float(radial[0]))
        points, _ = points_on_roof(fit.camera, roof, pixels)
        own = lens._replace(radial=float(radial[1]))
        dense = fit_projector(points, unwrapped_phase, start=projector, gate=1e3, lens=own)
        return np.array([np.sum(fit.residual**2), np.mean(dense.residual**2)])

    counts: FloatArray = np.array([start, lens.radial]) / np.where(unit > 0, unit, 1.0)
    bend: FloatArray = np.eye(2)
    for _ in range(_ROUNDS):
        here = misfit(counts)
        variance = np.array(
            [
                max(here[0] / max(2 * len(world) - 12, 1), _FINEST_MARK_PX**2),
                max(here[1], _FINEST_PHASE_RAD**2) / min(_EFFECTIVE_POINTS, len(pixels)),
            ]
        )
        slope, bend = _slope_and_bend(misfit, counts, here, variance, free)
        own_bend = bend[np.ix_(free, free)]
        if np.any(np.linalg.eigvalsh(own_bend) <= 0):
            return LensFits(fit_camera_with_radial(world, marks_px, centre=centre, radial=0.0), 0.0, np.zeros((2, 2)))
        counts[free] -= np.linalg.solve(own_bend, slope[free])
    counts, covariance = _kept(counts, bend, free, significance)
    radial, covariance = counts * unit, covariance * np.outer(unit, unit)
    fit = fit_camera_with_radial(world, marks_px, centre=centre, radial=float(radial[0]))
    moved = fit_camera_with_radial(world, marks_px, centre=centre, radial=float(radial[0] + unit[0]))
    along = np.append((moved.camera.matrix - fit.camera.matrix).ravel()[:11] / unit[0], 1.0)
    fit = fit._replace(covariance=fit.covariance + covariance[0, 0] * np.outer(along, along))
    return LensFits(fit, float(radial[1]), covariance)


def _slope_and_bend(
    misfit: Callable[[FloatArray], FloatArray],
    at: FloatArray,
    here: FloatArray,
    variance: FloatArray,
    free: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Gradient (2,) and second derivatives (2, 2) of χ² by differences of one unit; 0 and 1 where not free."""
    slope, bend = np.zeros(2), np.eye(2)
    middle = float(np.sum(here / variance))

    def cost(move: FloatArray) -> float:
        return float(np.sum(misfit(at + move) / variance))

    for one in free:
        move = np.eye(2)[one]
        ahead, behind = cost(move), cost(-move)
        slope[one], bend[one, one] = (ahead - behind) / 2.0, ahead - 2.0 * middle + behind
    if len(free) == 2:
        both = cost(np.ones(2))
        bend[0, 1] = bend[1, 0] = both - middle - slope.sum() - np.trace(bend) / 2.0
    return slope, bend


def _kept(best: FloatArray, bend: FloatArray, free: IntArray, significance: float) -> tuple[FloatArray, FloatArray]:
    """The lens terms worth keeping (2,), the others 0, and their covariance (2, 2).

    Where the two are hardly told apart and neither is clearly 0, both are kept or none: one alone would take up what
    the other does.
    About its minimum χ² is quadratic: what it costs to hold a term at 0, and where the other then goes, follows.
    """
    price: float = np.inf
    counts, covariance = np.zeros(2), np.zeros((2, 2))
    alike = len(free) == 2 and abs(bend[0, 1]) > ALIKE * np.sqrt(bend[0, 0] * bend[1, 1])
    doubtful = alike and bool((np.abs(best) > DOUBTFUL * np.sqrt(2.0 * np.diag(np.linalg.inv(bend)))).all())
    for choice in ([], [0], [1], [0, 1]):
        if not set(choice) <= set(free.tolist()) or (doubtful and len(choice) == 1):
            continue
        held = [one for one in free.tolist() if one not in choice]
        values = np.zeros(2)
        if choice:
            own = bend[np.ix_(choice, choice)]
            values[choice] = best[choice] + np.linalg.solve(own, bend[np.ix_(choice, held)] @ best[held])
        off = values - best
        own_price = 0.5 * float(off @ bend @ off) + significance**2 * len(choice)
        if own_price < price:
            price, counts, covariance = own_price, values, np.zeros((2, 2))
            if choice:
                covariance[np.ix_(choice, choice)] = 2.0 * np.linalg.inv(own)
    return counts, covariance
