"""Points come back from pixel and phase, with their derivative and their uncertainty."""

from __future__ import annotations

import numpy as np

from rahas.kernels.camera import fit_camera
from rahas.kernels.projector import fit_projector, phase_of_projector
from rahas.kernels.rig_uncertainty import depth_std_from_calibration, rig_covariance
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from tests.roof_scene import HEIGHT, WIDTH, camera_at, marks_in_image, projector_above, roof_target, see_relief


def test_points_are_exact_and_solve_the_thesis_system() -> None:
    camera, projector = camera_at(radial=-2e-7), projector_above()
    scene = see_relief(camera, projector)
    origin, direction = rays_of_camera(camera, pixel_grid(HEIGHT, WIDTH))
    result = triangulate(origin, direction, scene.unwrapped_phase, projector)
    np.testing.assert_allclose(result.points, scene.points, atol=1e-6)
    step = triangulate(origin, direction, scene.unwrapped_phase + 1e-4, projector)
    np.testing.assert_allclose((step.points - result.points) / 1e-4, result.per_radian, rtol=2e-3, atol=1e-4)


def test_equation_2_17() -> None:
    camera, projector = camera_at(), projector_above()
    (x, y), phase = (101.0, 77.0), 31.0
    rows = np.vstack([camera.matrix[:2], projector[:1]])
    common = np.vstack([camera.matrix[2], camera.matrix[2], projector[1]])
    system = rows - np.array([x, y, phase / (2 * np.pi)])[:, None] * common
    point = np.linalg.solve(system[:, :3], -system[:, 3])
    origin, direction = rays_of_camera(camera, np.array([x, y]))
    np.testing.assert_allclose(triangulate(origin, direction, np.array(phase), projector).points, point, rtol=1e-9)


def test_missing_phase_gives_no_point() -> None:
    camera, projector = camera_at(), projector_above()
    origin, direction = rays_of_camera(camera, pixel_grid(4, 5))
    result = triangulate(origin, direction, np.full((4, 5), np.nan), projector)
    assert np.isnan(result.points).all()
    assert np.isnan(result.per_radian).all()


def test_calibration_uncertainty_is_what_repeated_calibrations_scatter() -> None:
    rng = np.random.default_rng(8)
    camera, projector, target = camera_at(), projector_above(), roof_target()
    roof = fit_roof(target)
    pixels = pixel_grid(HEIGHT, WIDTH, step=12).reshape(-1, 2)
    truth = phase_of_projector(projector, points_on_roof(camera, roof, pixels)[0])
    scan = see_relief(camera, projector)
    grid, phase = pixel_grid(HEIGHT, WIDTH, step=40), scan.unwrapped_phase[::40, ::40]
    depths, predicted = [], []
    for _ in range(40):
        seen = marks_in_image(camera) + rng.normal(0, 0.05, (18, 2))
        fit = fit_camera(target, seen, centre=camera.centre)
        points, _ = points_on_roof(fit.camera, roof, pixels)
        found = fit_projector(points, truth + rng.normal(0, 0.03, truth.shape), start=projector, gate=8.0)
        covariance = rig_covariance(fit, roof, pixels, found.matrix, found.covariance, reach_mm=target)
        values = np.concatenate([fit.camera.matrix.ravel()[:11], [fit.camera.radial], found.matrix.ravel()[:7], [0.0]])
        origin, direction = rays_of_camera(fit.camera, grid)
        depths.append(triangulate(origin, direction, phase, found.matrix).points[..., 2])
        predicted.append(depth_std_from_calibration(values, covariance, camera.centre, grid, phase))
    ratio = np.std(depths, axis=0) / np.median(predicted, axis=0)
    assert 0.7 < np.median(ratio) < 1.4
