"""Radial distortion comes from the dense phase where marks alone do not show it."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.camera import fit_camera
from rahas.kernels.projector import fit_projector, phase_of_projector
from rahas.kernels.radial_profile import fit_radial
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from tests.roof_scene import HEIGHT, WIDTH, camera_at, marks_in_image, projector_above, roof_target, see_relief

ONE_PERCENT_AT_THE_CORNER = -2.1e-7


@pytest.mark.parametrize("radial", [0.0, ONE_PERCENT_AT_THE_CORNER])
def test_distortion_and_depth(radial: float) -> None:
    rng = np.random.default_rng(6)
    camera, projector, target = camera_at(radial=radial), projector_above(), roof_target()
    roof = fit_roof(target)
    pixels = pixel_grid(HEIGHT, WIDTH, step=6).reshape(-1, 2)
    phase = phase_of_projector(projector, points_on_roof(camera, roof, pixels)[0])
    phase += rng.normal(0, 0.03, phase.shape) + 0.03 * np.cos(phase)
    seen = marks_in_image(camera) + rng.normal(0, 0.03, (18, 2))
    plain = fit_camera(target, seen, centre=camera.centre)
    first = fit_projector(points_on_roof(plain.camera, roof, pixels)[0], phase, gate=1e3)
    fit = fit_radial(
        target,
        seen,
        roof,
        pixels,
        phase,
        first.matrix,
        centre=camera.centre,
        start=plain.camera.radial,
        significance=4.0,
    )
    if radial == 0.0:
        assert fit.camera.camera.radial == 0.0
    else:
        assert abs(fit.camera.camera.radial / radial - 1) < 0.2
        assert 0.0 < np.sqrt(fit.camera.covariance[11, 11]) < 0.25 * abs(radial)
    scan = see_relief(camera, projector)
    errors = []
    for model in (plain.camera, fit.camera.camera):
        matrix = fit_projector(points_on_roof(model, roof, pixels)[0], phase, gate=1e3).matrix
        origin, direction = rays_of_camera(model, pixel_grid(HEIGHT, WIDTH))
        depth = triangulate(origin, direction, scan.unwrapped_phase, matrix).points[..., 2]
        errors.append(float(np.sqrt(np.mean((depth - scan.points[..., 2]) ** 2))))
    assert errors[1] < 0.1
    assert errors[1] <= errors[0] + 0.02
