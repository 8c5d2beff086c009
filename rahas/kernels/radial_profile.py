"""Radial distortion from marks and dense phase together.

Eighteen marks in the middle of the image tell little about the lens at its corners. The phase on the roof's two planes
reaches further: only with the right k1 is it a projective function of the points that the camera names. The camera's
matrix stays the marks' own; k1 alone is moved, along the profile of both misfits.
"""

from __future__ import annotations

import numpy as np

from rahas.kernels.camera import CameraFit, fit_camera_with_radial
from rahas.kernels.projector import fit_projector
from rahas.kernels.roof import Roof, points_on_roof
from rahas.typing import FloatArray

_EFFECTIVE_POINTS = 400.0  # the phase's errors hang together over many pixels: it never counts as more points than that
_FINEST_MARK_PX = 0.01
_STEP_SHARE = 0.002  # of the distance from the centre, at the farthest point


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
) -> CameraFit:
    """Camera of the marks ``world`` (n, 3), ``marks_px`` (n, 2) with the k1 that suits them and the phase best.

    ``pixels`` (m, 2), ``unwrapped_phase`` (m,) on the roof. k1 is 0 unless it is ``significance`` standard deviations
    off zero; its standard deviation is in the covariance.
    """
    farthest = float(np.max(np.sum((pixels - centre) ** 2, axis=1)))
    step = _STEP_SHARE / farthest
    some = slice(None, None, max(1, len(pixels) // 4000))
    pixels, unwrapped_phase = pixels[some], unwrapped_phase[some]

    def misfit(radial: float) -> tuple[float, float]:
        fit = fit_camera_with_radial(world, marks_px, centre=centre, radial=radial)
        points, _ = points_on_roof(fit.camera, roof, pixels)
        dense = fit_projector(points, unwrapped_phase, start=projector, gate=1e3)
        return float(np.sum(fit.residual**2)), float(np.mean(dense.residual**2))

    radial, deviation = start, np.inf
    for _ in range(3):
        middle = misfit(radial)
        freedom = max(2 * len(world) - 12, 1)
        mark_variance = max(middle[0] / freedom, _FINEST_MARK_PX**2)
        phase_variance = max(middle[1], 1e-6) / min(_EFFECTIVE_POINTS, len(pixels))
        low, here, high = (
            m[0] / mark_variance + m[1] / phase_variance for m in (misfit(radial - step), middle, misfit(radial + step))
        )
        bend = (low - 2.0 * here + high) / step**2
        if bend <= 0:
            break
        radial -= (high - low) / (2.0 * step) / bend
        deviation = float(np.sqrt(2.0 / bend))
    if not abs(radial) > significance * deviation:
        return fit_camera_with_radial(world, marks_px, centre=centre, radial=0.0)
    fit = fit_camera_with_radial(world, marks_px, centre=centre, radial=radial)
    moved = fit_camera_with_radial(world, marks_px, centre=centre, radial=radial + step)
    slope = np.append((moved.camera.matrix - fit.camera.matrix).ravel()[:11] / step, 1.0)
    return fit._replace(covariance=fit.covariance + deviation**2 * np.outer(slope, slope))
