"""How far the calibration's own error moves what is measured with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rahas.kernels.camera import CameraFit, camera_from_parameters, parameter_scale
from rahas.kernels.levenberg_marquardt import inverse_of_normal
from rahas.kernels.projector import phase_of_projector, projector_from_parameters
from rahas.kernels.roof import Roof, points_on_roof
from rahas.kernels.triangulation import rays_of_camera, triangulate
from rahas.typing import AnyArray, FloatArray

_POINTS = 3000
CAMERA_PARAMETERS = 12
"""m1…m11, k1; the projector's m5…m11 follow."""


def rig_covariance(
    camera_fit: CameraFit,
    roof: Roof,
    pixels: FloatArray,
    projector: FloatArray,
    projector_covariance: FloatArray,
    *,
    reach_mm: FloatArray,
) -> FloatArray:
    """Covariance (19, 19) of camera and projector together.

    The projector is fitted on points that the camera names, so an error of the camera is followed by the projector,
    which undoes part of it: ∂projector/∂camera from the same ``pixels`` (n, 2) of the roof. ``reach_mm`` (m, 3) are
    world points that tell the scale.
    """
    camera = camera_fit.camera
    pixels = pixels[:: max(1, len(pixels) // _POINTS)]
    values = np.append(camera.matrix.ravel()[:11], camera.radial)
    scale = parameter_scale(values, reach_mm, camera.centre)

    def phase_seen(parameters: FloatArray) -> FloatArray:
        points, _ = points_on_roof(camera_from_parameters(parameters, camera.centre), roof, pixels)
        return phase_of_projector(projector, points)

    by_camera = _derivative(phase_seen, values, scale)
    points, _ = points_on_roof(camera, roof, pixels)
    own = projector.ravel()[:7]
    by_projector = _derivative(
        lambda p: phase_of_projector(projector_from_parameters(p), points), own, _projector_scale(projector, reach_mm)
    )
    follow = -inverse_of_normal(by_projector.T @ by_projector) @ (by_projector.T @ by_camera)
    spread = np.vstack([np.eye(CAMERA_PARAMETERS), follow])
    covariance: FloatArray = spread @ camera_fit.covariance @ spread.T
    covariance[CAMERA_PARAMETERS:, CAMERA_PARAMETERS:] += projector_covariance
    return covariance


def depth_std_from_calibration(
    parameters: FloatArray, covariance: FloatArray, centre: FloatArray, pixels: FloatArray, unwrapped_phase: AnyArray
) -> FloatArray:
    """Standard deviation (…) of Z in mm that ``covariance`` (19, 19) of ``parameters`` (19,) brings about.

    ``pixels`` (…, 2) and ``unwrapped_phase`` (…) name the points.
    """

    def depth(values: FloatArray) -> FloatArray:
        camera = camera_from_parameters(values[:CAMERA_PARAMETERS], centre)
        origin, direction = rays_of_camera(camera, pixels)
        projector = projector_from_parameters(values[CAMERA_PARAMETERS:])
        return triangulate(origin, direction, unwrapped_phase, projector).points[..., 2].ravel()

    sizes = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    moving = sizes > 0
    if not moving.any():
        return np.zeros(unwrapped_phase.shape)
    derivative = np.zeros((unwrapped_phase.size, parameters.size))
    derivative[:, moving] = _derivative(depth, parameters, np.where(moving, sizes, 0.0) * 1e4, only=moving)
    variance = np.einsum("ni,ij,nj->n", derivative, covariance, derivative)
    deviation: FloatArray = np.sqrt(np.maximum(variance, 0.0)).reshape(unwrapped_phase.shape)
    return deviation


def _projector_scale(projector: FloatArray, reach_mm: FloatArray) -> FloatArray:
    reach = float(np.abs(reach_mm).max()) + 1.0
    turns = abs(float(projector[0, 3])) + 1.0
    return np.array([turns / reach] * 3 + [turns] + [1.0 / reach] * 3)


def _derivative(
    function: Callable[[FloatArray], FloatArray], at: FloatArray, scale: FloatArray, *, only: AnyArray | None = None
) -> FloatArray:
    """Forward differences, a column a parameter, steps of 1e-6 of ``scale``."""
    here = function(at)
    columns = []
    for index in range(at.size) if only is None else np.nonzero(only)[0]:
        moved = at.copy()
        moved[index] += 1e-6 * scale[index]
        columns.append((function(moved) - here) / (1e-6 * scale[index]))
    return np.column_stack(columns)
