"""Is the rig still as it was calibrated? The scan's first hold against the calibration's first stop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import camera_from_parameters
from rahas.kernels.derivatives import forward_differences
from rahas.kernels.first_stop import fit_phase_change
from rahas.kernels.projector import projector_from_parameters
from rahas.kernels.projector_lens import Lens, phase_through_lens, phase_without_lens, slide_tangents
from rahas.kernels.rig_change import CHANGES, explain_change
from rahas.kernels.rig_uncertainty import CAMERA_PARAMETERS, DEPTH_PARAMETERS
from rahas.kernels.sampling import evenly_spread
from rahas.kernels.triangulation import TURN, Triangulation, rays_of_camera, triangulate
from rahas.stages.first_hold import FirstHold, demodulated_at, demodulated_phase, hold_pixels
from rahas.stages.rig import Rig
from rahas.typing import AnyArray, FloatArray

_PIXELS = 24000
_FEWEST = 500
_STEP_RAD = 1e-3
_COARSE = 60  # every so many of them for what the calibration's own uncertainty does


class Consistency(NamedTuple):
    """How the first hold's pattern lies beside where the calibration says, measured minus expected."""

    offset_rad: float
    """Mean over the field, −π … π."""
    offset_std_rad: float
    gradient_rad: float
    """Rms over the field of what is left besides the mean: tilt, scale and keystone."""
    gradient_std_rad: float
    scan_phase_rad: float
    """Rms over the field of what the simplest explanation of the difference adds to the scan's own phase."""
    depth_mm: float
    """The same as an error of Z."""
    depth_std_mm: float
    changes: dict[str, float]
    """That explanation: slide in its holder in rad of phase, turns of the projector in degrees, zoom as a share."""
    cause: str
    """The one of them that moves the pattern most; empty where there is nothing to explain."""


def check_consistency(
    rig: Rig, hold: FirstHold | None, *, unwrapped_phase: AnyArray, background: AnyArray, modulation: AnyArray
) -> Consistency | None:
    """Compare; ``None`` where calibration or scan has no usable first hold. All images are (y, x).

    Each pixel's measured point names the phase that the calibration's first stop shows there, whatever the surface. The
    figures are those of a slide moved in its holder, which moves the scan's phase by as much.
    """
    if rig.first_stop is None or hold is None or hold.level.shape != unwrapped_phase.shape:
        return None
    measured = np.isfinite(unwrapped_phase) & np.isfinite(background) & np.isfinite(modulation)
    rows, columns = evenly_spread(measured, _PIXELS)
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    scan_phase = np.asarray(unwrapped_phase, dtype=np.float64)[rows, columns]
    surface = _points(rig, rig.parameters, pixels, scan_phase)
    seen = np.isfinite(surface.points[:, 2])
    if np.count_nonzero(seen) < _FEWEST:
        return None
    pixels, scan_phase = pixels[seen], scan_phase[seen]
    points, per_radian = surface.points[seen], surface.per_radian[seen]
    height, width = measured.shape
    terms = _low_order(pixels, width, height)
    expected = phase_through_lens(rig.first_stop, rig.lens, points)
    # stripes off the epipolar lines: an error of the scan's phase moves the points along the rays, and what is expected
    ahead = phase_through_lens(rig.first_stop, rig.lens, points + _STEP_RAD * per_radian)
    followed = (ahead - expected) / _STEP_RAD
    own_columns = (1.0 - followed)[:, None] * terms
    try:
        demodulated = demodulated_at(demodulated_phase(hold, background, modulation, measured), pixels, (height, width))
        beside = demodulated - expected
        beside -= TURN * np.rint(np.median(beside) / TURN)
        start = np.linalg.lstsq(own_columns, beside, rcond=None)[0]
        fit = fit_phase_change(hold_pixels(hold, background, modulation, pixels), expected, own_columns, start)
    except ValueError:
        return None
    some = slice(None, None, _COARSE)
    covariance = fit.covariance + _calibration_covariance(rig, pixels[some], scan_phase[some], own_columns[some])
    mean = terms.mean(axis=0)
    field, varying = terms @ fit.terms, terms - mean
    turns = TURN * float(np.rint(field.mean() / TURN))
    own = fit.terms - np.array([turns, *np.zeros(terms.shape[1] - 1)])
    u, v, per_tangent_first, per_tangent = slide_tangents(rig.projector, rig.first_stop, rig.lens.centre, points)
    change = explain_change(
        own,
        covariance,
        own_columns,
        u,
        v,
        camera_zoom=(_zoomed(expected, pixels, width, height), _zoomed(scan_phase, pixels, width, height)),
        followed=followed,
        per_tangent_first=per_tangent_first,
        per_tangent=per_tangent,
    )
    added = change.phase_of_each.sum(axis=1)
    size = change.size * np.array([1.0, *np.rad2deg(np.ones(3)), 1.0, 1.0])
    # by how much each moves a pattern of so many radians a tangent
    reach = np.abs(change.size) * np.array([1.0, *np.full(5, per_tangent)])
    return Consistency(
        offset_rad=float(field.mean() - turns),
        offset_std_rad=float(np.sqrt(mean @ covariance @ mean)),
        gradient_rad=float(field.std()),
        gradient_std_rad=float(np.sqrt(np.mean(np.einsum("ni,ij,nj->n", varying, covariance, varying)))),
        scan_phase_rad=_rms(added),
        depth_mm=_rms(added * per_radian[:, 2]),
        depth_std_mm=_rms(change.phase_std * per_radian[:, 2]),
        changes=dict(zip(CHANGES, size.tolist(), strict=True)),
        cause=CHANGES[int(np.argmax(reach))] if reach.any() else "",
    )


def _points(rig: Rig, parameters: FloatArray, pixels: FloatArray, scan_phase: FloatArray) -> Triangulation:
    """World points (n, 3) of a rig with these parameters."""
    camera = camera_from_parameters(parameters[:CAMERA_PARAMETERS], rig.camera.camera.centre)
    projector = projector_from_parameters(parameters[CAMERA_PARAMETERS : DEPTH_PARAMETERS - 1])
    lens = Lens(float(parameters[DEPTH_PARAMETERS - 1]), rig.lens.centre)
    origin, direction = rays_of_camera(camera, pixels)
    plain = phase_without_lens(origin, direction, scan_phase, projector, lens)
    return triangulate(origin, direction, plain, projector)


def _calibration_covariance(rig: Rig, pixels: FloatArray, scan_phase: FloatArray, columns: FloatArray) -> FloatArray:
    """Covariance of the terms of ``columns`` (n, p) in the expected phase that the calibration's uncertainty brings."""

    def expected(parameters: FloatArray) -> FloatArray:
        points = _points(rig, parameters, pixels, scan_phase).points
        lens = Lens(float(parameters[DEPTH_PARAMETERS - 1]), rig.lens.centre)
        return phase_through_lens(projector_from_parameters(parameters[DEPTH_PARAMETERS:]), lens, points)

    size = np.sqrt(np.maximum(np.diag(rig.covariance), 0.0))
    moving = np.flatnonzero(size > 0)
    if not moving.size:
        return np.zeros((columns.shape[1], columns.shape[1]))
    by_parameter = forward_differences(expected, rig.parameters, 1e4 * size, only=moving)
    of_terms = np.linalg.lstsq(columns, by_parameter, rcond=None)[0]
    covariance: FloatArray = of_terms @ rig.covariance[np.ix_(moving, moving)] @ of_terms.T
    return covariance


def _zoomed(phase: FloatArray, pixels: FloatArray, width: int, height: int) -> FloatArray:
    """−p·∇phase (n,): what a zoom of the camera by one adds, from the phase's low order over the image."""
    fit = np.linalg.lstsq(_low_order(pixels, width, height), phase, rcond=None)[0]
    middle, step = np.array([(width - 1) / 2.0, (height - 1) / 2.0]), 1e-4
    moved = middle + (pixels - middle) * (1.0 + step)
    ahead: FloatArray = (_low_order(moved, width, height) - _low_order(pixels, width, height)) @ fit
    return -ahead / step


def _low_order(pixels: FloatArray, width: int, height: int) -> FloatArray:
    """1, x̂, ŷ, x̂², x̂ŷ, ŷ² (n, 6) at pixels (n, 2), coordinates brought to −1 … 1."""
    x, y = 2.0 * pixels[:, 0] / (width - 1) - 1.0, 2.0 * pixels[:, 1] / (height - 1) - 1.0
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
