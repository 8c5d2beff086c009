"""The camera: world mm → image pixels by a 3 × 4 matrix and one radial term (thesis 2.3.1, equations 2.9–2.12).

| name | symbol | meaning |
|---|---|---|
| matrix | M^c | (3, 4), m12 = 1: λ·(x, y, 1) = M·(X, Y, Z, 1), undistorted pixels |
| radial | k1 | 1/px²: seen − centre = (undistorted − centre)·(1 + k1·r²), r the undistorted distance from the centre |
| centre | | (x, y) px about which the radial term acts: the middle of the image |

Pixel centres lie at integers, x to the right, y down.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.levenberg_marquardt import inverse_of_normal, minimise_squares
from rahas.typing import FloatArray

MIN_MARKS = 6
"""Points that a direct linear transform needs."""


class Camera(NamedTuple):
    """A camera with its radial term."""

    matrix: FloatArray
    """(3, 4), m12 = 1."""
    radial: float
    """k1 in 1/px², 0 where the marks show no distortion."""
    centre: FloatArray
    """(2,) px."""

    @property
    def origin(self) -> FloatArray:
        """(3,) mm, centre of projection."""
        origin: FloatArray = -np.linalg.inv(self.matrix[:, :3]) @ self.matrix[:, 3]
        return origin


class CameraFit(NamedTuple):
    """A camera fitted to marks."""

    camera: Camera
    residual: FloatArray
    """(n, 2) px, measured minus projected."""
    covariance: FloatArray
    """(12, 12) of m1…m11 and k1; the last row and column are 0 where k1 is not fitted."""
    sigma_px: float
    """Standard deviation of one image coordinate, from the residuals and the degrees of freedom."""


def project(camera: Camera, world: FloatArray) -> FloatArray:
    """Image points (…, 2) in px of world points (…, 3) in mm (equations 2.11 and 2.12)."""
    projected = world @ camera.matrix[:, :3].T + camera.matrix[:, 3]
    return distort(projected[..., :2] / projected[..., 2:], radial=camera.radial, centre=camera.centre)


def distort(pixels: FloatArray, *, radial: float, centre: FloatArray) -> FloatArray:
    """Where undistorted image points (…, 2) are really seen."""
    if radial == 0.0:
        return pixels
    offset = pixels - centre
    radius2 = np.sum(offset**2, axis=-1, keepdims=True)
    seen: FloatArray = centre + offset * (1.0 + radial * radius2)
    return seen


def undistort(pixels: FloatArray, *, radial: float, centre: FloatArray) -> FloatArray:
    """Inverse of :func:`distort`: Newton's iteration on the radius; exact to 1e-9 px for distortions below 10 %."""
    if radial == 0.0:
        return pixels
    offset = pixels - centre
    seen2 = np.sum(offset**2, axis=-1, keepdims=True)
    shrink = np.ones_like(seen2)  # undistorted radius / seen radius
    for _ in range(4):
        cubic = radial * seen2 * shrink**2
        shrink -= (shrink * (1.0 + cubic) - 1.0) / (1.0 + 3.0 * cubic)
    plain: FloatArray = centre + offset * shrink
    return plain


def camera_matrix_from_marks(world: FloatArray, pixels: FloatArray) -> FloatArray:
    """Direct linear transform, both point sets normalised (Hartley): matrix (3, 4) with m12 = 1.

    Raises
    ------
    ValueError
        Fewer than six points, or points from which no camera follows (all on one plane).
    """
    if len(world) < MIN_MARKS:
        raise ValueError(f"{len(world)} points, a camera needs {MIN_MARKS}")
    to_world, to_image = _normaliser(world), _normaliser(pixels)
    points = world @ to_world[:3, :3].T + to_world[:3, 3]
    image = pixels @ to_image[:2, :2].T + to_image[:2, 2]
    homogeneous = np.column_stack([points, np.ones(len(points))])
    zero = np.zeros_like(homogeneous)
    rows = np.vstack(
        [
            np.hstack([homogeneous, zero, -image[:, :1] * homogeneous]),
            np.hstack([zero, homogeneous, -image[:, 1:] * homogeneous]),
        ]
    )
    _, singular, vectors = np.linalg.svd(rows, full_matrices=False)
    if singular[-2] < 1e-6 * singular[0]:
        raise ValueError("the points lie on one plane: no camera follows from them")
    matrix: FloatArray = np.linalg.inv(to_image) @ vectors[-1].reshape(3, 4) @ to_world
    if abs(matrix[2, 3]) < 1e-12 * np.abs(matrix).max():
        raise ValueError("the world's origin lies in the camera's own plane")
    matrix /= matrix[2, 3]
    return matrix


def fit_camera(world: FloatArray, pixels: FloatArray, *, centre: FloatArray, significance: float = 4.0) -> CameraFit:
    """Camera of least squared residuals; k1 is fitted only if it is ``significance`` standard deviations off zero.

    ``world`` (n, 3) mm, ``pixels`` (n, 2) px as seen. With fewer than seven marks k1 is never fitted.
    """
    plain = _fit(world, pixels, centre, with_radial=False)
    if 2 * len(world) <= 12:
        return plain
    bent = _fit(world, pixels, centre, with_radial=True)
    deviation = np.sqrt(max(bent.covariance[11, 11], 0.0))
    return bent if abs(bent.camera.radial) > significance * deviation else plain


def camera_from_parameters(parameters: FloatArray, centre: FloatArray) -> Camera:
    """Camera of m1…m11 and, where given, k1."""
    radial = float(parameters[11]) if parameters.size > 11 else 0.0
    return Camera(np.append(parameters[:11], 1.0).reshape(3, 4), radial, centre)


def parameter_scale(parameters: FloatArray, world: FloatArray, centre: FloatArray) -> FloatArray:
    """Typical sizes of m1…m11 (and k1): what moves the image by about a pixel's order."""
    reach = float(np.abs(world).max()) + 1.0
    image = float(np.abs(centre).max()) + 1.0
    scale = np.array([image / reach] * 3 + [image] + [image / reach] * 3 + [image] + [1.0 / reach] * 3)
    return np.append(scale, 1.0 / image**2) if parameters.size > 11 else scale


def fit_camera_with_radial(world: FloatArray, pixels: FloatArray, *, centre: FloatArray, radial: float) -> CameraFit:
    """Camera of least squared residuals for a k1 that is known; its variance counts as 0."""
    return _fit(world, pixels, centre, with_radial=False, radial=radial)


def _fit(
    world: FloatArray, pixels: FloatArray, centre: FloatArray, *, with_radial: bool, radial: float = 0.0
) -> CameraFit:
    start = camera_matrix_from_marks(world, undistort(pixels, radial=radial, centre=centre)).ravel()[:11]
    if with_radial:
        start = np.append(start, radial)

    def camera_of(parameters: FloatArray) -> Camera:
        camera = camera_from_parameters(parameters, centre)
        return camera if with_radial else camera._replace(radial=radial)

    def residual_of(parameters: FloatArray) -> FloatArray:
        return (pixels - project(camera_of(parameters), world)).ravel()

    fit = minimise_squares(residual_of, start, scale=parameter_scale(start, world, centre))
    freedom = max(fit.residual.size - start.size, 1)
    variance = float(fit.residual @ fit.residual) / freedom
    covariance = np.zeros((12, 12))
    covariance[: start.size, : start.size] = variance * inverse_of_normal(fit.normal_matrix)
    return CameraFit(camera_of(fit.parameters), fit.residual.reshape(-1, 2), covariance, float(np.sqrt(variance)))


def _normaliser(points: FloatArray) -> FloatArray:
    """Similarity that moves ``points`` to their mean and scales them to a mean distance of √dimension."""
    size = points.shape[1]
    mean = points.mean(axis=0)
    spread = float(np.mean(np.linalg.norm(points - mean, axis=1))) or 1.0
    transform = np.eye(size + 1)
    transform[:size, :size] *= np.sqrt(size) / spread
    transform[:size, size] = -mean * np.sqrt(size) / spread
    return transform
