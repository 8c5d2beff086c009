"""Both lenses, the projector and its first stop from the dense phase on the target, the camera's marks at hand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.first_stop import FirstStopFit, fit_first_stop
from rahas.kernels.mark_identity import mark_spacing
from rahas.kernels.projector import MIN_POINTS, fit_projector
from rahas.kernels.projector_lens import NO_LENS, Lens, centre_above_camera, phase_through_lens, projector_centre
from rahas.kernels.radial_profile import fit_radial
from rahas.kernels.roof import Roof
from rahas.kernels.target_phase import TargetPhaseFit, fit_projector_on_roof
from rahas.kernels.triangulation import rays_of_camera
from rahas.params import CalibrationParams
from rahas.stages.first_hold import FirstHold, demodulated_at, demodulated_phase, hold_pixels
from rahas.stages.sighting import Sighting, Target
from rahas.typing import AnyArray, FloatArray

_ROUNDS = 3


class TargetImages(NamedTuple):
    """What the scan of the target measured, (y, x)."""

    unwrapped_phase: AnyArray
    """rad, NaN where not measured."""
    background: AnyArray
    """a, grey levels."""
    modulation: AnyArray | None
    """b, grey levels; needed for the first hold only."""
    hold: FirstHold | None


class Projection(NamedTuple):
    """How world points are seen by the camera and lit by the projector."""

    sighting: Sighting
    """With the camera's radial term that suits marks and phase."""
    dense: TargetPhaseFit
    lens: Lens
    lens_covariance: FloatArray
    """(2, 2) of the camera's and the projector's k1."""
    first_stop: FirstStopFit | None

    @property
    def phase(self) -> FloatArray:
        """(n,) rad, measured at the dense points."""
        return phase_through_lens(self.dense.fit.matrix, self.lens, self.dense.points) + self.dense.fit.residual


def fit_projection(
    images: TargetImages,
    sighting: Sighting,
    target: Target,
    roof: Roof,
    mark_phase: FloatArray,
    params: CalibrationParams,
) -> Projection:
    """Fit projector and lenses in turn: each tells which points and which centre of projection the other may use.

    Raises
    ------
    CaptureProblem
        Too little phase on the target, or too little of it agrees with the two planes.
    """
    near = target.world.mean(axis=0)
    dense = _projector_of(images, sighting, target, roof, mark_phase, NO_LENS, params)
    fitted = Projection(sighting, dense, NO_LENS, np.zeros((2, 2)), None)
    fitted = fitted._replace(first_stop=_first_stop_of(images, fitted))
    for _ in range(_ROUNDS):
        former = fitted.lens.radial
        lens = fitted.lens._replace(centre=_centre_of(fitted, near))
        used = fitted.dense.fit.used
        lenses = fit_radial(
            target.world[sighting.row],
            sighting.centre,
            roof,
            fitted.dense.pixels[used],
            fitted.phase[used],
            fitted.dense.fit.matrix,
            centre=sighting.fit.camera.centre,
            start=fitted.sighting.fit.camera.radial,
            significance=params.radial_significance,
            projector_lens=lens,
        )
        lens = lens._replace(radial=lenses.projector_radial)
        own = sighting._replace(fit=lenses.camera)
        dense = _projector_of(images, own, target, roof, mark_phase, lens, params)
        fitted = Projection(own, dense, lens, lenses.covariance, None)
        fitted = fitted._replace(first_stop=_first_stop_of(images, fitted))
        if abs(lens.radial - former) <= 0.3 * float(np.sqrt(lenses.covariance[1, 1])):
            break
    return fitted


def _centre_of(fitted: Projection, near: FloatArray) -> FloatArray:
    """The projector's centre of projection (3,) mm."""
    if fitted.first_stop is not None:
        return projector_centre(fitted.dense.fit.matrix, fitted.first_stop.matrix, near)
    camera_centre, _ = rays_of_camera(fitted.sighting.fit.camera, fitted.dense.pixels[:1])
    return centre_above_camera(fitted.dense.fit.matrix, camera_centre, near)


def _first_stop_of(images: TargetImages, fitted: Projection) -> FirstStopFit | None:
    """The projector at the first stop, from the first hold at the dense points; ``None`` where there is none."""
    if images.hold is None or images.modulation is None:
        return None
    used = fitted.dense.fit.used
    pixels, points = fitted.dense.pixels[used], fitted.dense.points[used]
    measured = np.isfinite(images.unwrapped_phase)
    shape = (measured.shape[0], measured.shape[1])
    try:
        start = demodulated_phase(images.hold, images.background, images.modulation, measured)
        return fit_first_stop(
            hold_pixels(images.hold, images.background, images.modulation, pixels),
            points,
            demodulated_at(start, pixels, shape),
            fitted.lens,
        )
    except ValueError:
        return None


def _projector_of(
    images: TargetImages,
    sighting: Sighting,
    target: Target,
    roof: Roof,
    mark_phase: FloatArray,
    lens: Lens,
    params: CalibrationParams,
) -> TargetPhaseFit:
    known = np.isfinite(mark_phase)
    start = None
    if known.sum() > MIN_POINTS + 2:
        start = fit_projector(target.world[sighting.row[known]], mark_phase[known], lens=lens).matrix
    try:
        dense = fit_projector_on_roof(
            images.unwrapped_phase,
            sighting.fit.camera,
            roof,
            target.world,
            mark_radius_mm=sighting.radius_mm,
            margin_mm=0.3 * float(np.median(mark_spacing(target.world))),
            start=start,
            lens=lens,
        )
    except ValueError as error:
        raise CaptureProblem(
            "calibration",
            "projector_points",
            f"Too little phase was measured on the target ({error}). Scan it again with the lamp's stripes sharp and "
            "bright on both slopes.",
            value=0,
            limit=100,
            unit="points",
        ) from None
    if dense.inlier_share < params.min_projector_inlier_share:
        raise CaptureProblem(
            "calibration",
            "projector_inlier_share",
            f"Only {100 * dense.inlier_share:.0f} % of what was measured between the target's marks agrees with its "
            "two planes. Scan the target again, turning lever and crank slowly and evenly.",
            value=round(dense.inlier_share, 4),
            limit=params.min_projector_inlier_share,
            unit="",
        )
    return dense
