"""How far the calibration's own error moves what is measured with it."""

from __future__ import annotations

import numpy as np

from rahas.kernels.camera import CameraFit, camera_from_parameters, parameter_scale
from rahas.kernels.derivatives import forward_differences
from rahas.kernels.first_stop import FirstStopFit
from rahas.kernels.levenberg_marquardt import inverse_of_normal
from rahas.kernels.projector import projector_from_parameters, projector_scale
from rahas.kernels.projector_lens import NO_LENS, Lens, phase_through_lens, phase_without_lens
from rahas.kernels.roof import Roof, points_on_roof
from rahas.kernels.triangulation import rays_of_camera, triangulate
from rahas.typing import AnyArray, FloatArray

_POINTS = 3000
CAMERA_PARAMETERS = 12
"""m1…m11, k1; the projector's m5…m11 and k1 follow, then the first stop's m5…m11 where it is known."""
DEPTH_PARAMETERS = 20
"""Those that a depth depends on."""


def rig_covariance(
    camera_fit: CameraFit,
    roof: Roof,
    pixels: FloatArray,
    projector: FloatArray,
    projector_covariance: FloatArray,
    *,
    reach_mm: FloatArray,
    lens: Lens = NO_LENS,
    lens_covariance: FloatArray | None = None,
    first_stop: FirstStopFit | None = None,
) -> FloatArray:
    """Covariance (20, 20) of camera, projector and its lens together, (27, 27) with the ``first_stop``.

    The projector is fitted on points that the camera names, so an error of the camera is followed by the projector,
    which undoes part of it: ∂projector/∂camera from the same ``pixels`` (n, 2) of the roof; likewise an error of the
    lens. ``lens_covariance`` (2, 2) is of the camera's and the projector's k1. ``reach_mm`` (m, 3) are world points
    that tell the scale.
    """
    camera = camera_fit.camera
    pixels = pixels[:: max(1, len(pixels) // _POINTS)]
    values = np.append(camera.matrix.ravel()[:11], camera.radial)
    scale = parameter_scale(values, reach_mm, camera.centre)

    points, _ = points_on_roof(camera, roof, pixels)

    def follow(matrix: FloatArray) -> FloatArray:
        """∂(m5…m11)/∂(camera's parameters, projector's k1), (7, 13)."""

        def phase_seen(parameters: FloatArray) -> FloatArray:
            moved, _ = points_on_roof(camera_from_parameters(parameters[:-1], camera.centre), roof, pixels)
            return phase_through_lens(matrix, lens._replace(radial=float(parameters[-1])), moved)

        by_own = forward_differences(
            lambda p: phase_through_lens(projector_from_parameters(p), lens, points),
            matrix.ravel()[:7],
            projector_scale(matrix, reach_mm),
        )
        by_causes = forward_differences(phase_seen, np.append(values, lens.radial), np.append(scale, 1.0))
        return -inverse_of_normal(by_own.T @ by_own) @ (by_own.T @ by_causes)

    causes = np.zeros((CAMERA_PARAMETERS + 1, CAMERA_PARAMETERS + 1))
    causes[:-1, :-1] = camera_fit.covariance
    if lens_covariance is not None and lens_covariance[1, 1] > 0:
        causes[-1, -1] = lens_covariance[1, 1]
        if lens_covariance[0, 0] > 0:  # what goes with the camera's k1
            shared = camera_fit.covariance[:, -1] * (lens_covariance[0, 1] / lens_covariance[0, 0])
            causes[:-1, -1] = causes[-1, :-1] = shared
    to_itself = np.eye(CAMERA_PARAMETERS + 1)
    spread = np.vstack([to_itself[:-1], follow(projector), to_itself[-1:]])
    if first_stop is not None:
        spread = np.vstack([spread, follow(first_stop.matrix)])
    covariance: FloatArray = spread @ causes @ spread.T
    covariance[CAMERA_PARAMETERS : DEPTH_PARAMETERS - 1, CAMERA_PARAMETERS : DEPTH_PARAMETERS - 1] += (
        projector_covariance
    )
    if first_stop is not None:
        covariance[DEPTH_PARAMETERS:, DEPTH_PARAMETERS:] += first_stop.covariance
    return covariance


def depth_std_from_calibration(
    parameters: FloatArray,
    covariance: FloatArray,
    centre: FloatArray,
    pixels: FloatArray,
    unwrapped_phase: AnyArray,
    *,
    projector_centre: FloatArray | None = None,
) -> FloatArray:
    """Standard deviation (…) of Z in mm that ``covariance`` (p, p) of ``parameters`` (p,) brings about.

    Both of :func:`rig_covariance`, p = 20 or 27; ``centre`` (2,) px of the camera, ``projector_centre`` (3,) mm.
    ``pixels`` (…, 2) and ``unwrapped_phase`` (…) name the points.
    """
    parameters, covariance = parameters[:DEPTH_PARAMETERS], covariance[:DEPTH_PARAMETERS, :DEPTH_PARAMETERS]

    def depth(values: FloatArray) -> FloatArray:
        camera = camera_from_parameters(values[:CAMERA_PARAMETERS], centre)
        origin, direction = rays_of_camera(camera, pixels)
        projector = projector_from_parameters(values[CAMERA_PARAMETERS:])
        lens = NO_LENS if projector_centre is None else Lens(float(values[-1]), projector_centre)
        plain = phase_without_lens(origin, direction, unwrapped_phase, projector, lens)
        return triangulate(origin, direction, plain, projector).points[..., 2].ravel()

    sizes = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    moving = sizes > 0
    if not moving.any():
        return np.zeros(unwrapped_phase.shape)
    derivative = np.zeros((unwrapped_phase.size, parameters.size))
    derivative[:, moving] = forward_differences(depth, parameters, 1e4 * sizes, only=np.flatnonzero(moving))
    variance = np.einsum("ni,ij,nj->n", derivative, covariance, derivative)
    deviation: FloatArray = np.sqrt(np.maximum(variance, 0.0)).reshape(unwrapped_phase.shape)
    return deviation
