"""The projector's lens: its term is found from the phase on the roof, and undone on the way to points."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.camera import fit_camera
from rahas.kernels.projector import fit_projector
from rahas.kernels.projector_lens import (
    NO_LENS,
    Lens,
    centre_above_camera,
    phase_through_lens,
    phase_without_lens,
    projector_centre,
    slide_tangents,
    squared_tangent,
    turns_at_axis,
)
from rahas.kernels.radial_profile import LensFits, fit_radial
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from tests.roof_scene import (
    HEIGHT,
    WIDTH,
    camera_at,
    first_stop_above,
    marks_in_image,
    projector_above,
    projector_place,
    roof_target,
    see_relief,
)

ONE_PERCENT_IN_THE_CAMERA = -2.1e-7
ONE_PERCENT_IN_THE_PROJECTOR = 0.06
NEAR = np.array([30.0, -60.0, 0.0])


def test_axis_and_centre_are_the_projectors_own() -> None:
    projector, first = projector_above(), first_stop_above()
    np.testing.assert_allclose(projector_centre(projector, first, NEAR), projector_place(), atol=1e-6)
    level = np.array([projector_place()[0], -300.0, 640.0])
    np.testing.assert_allclose(centre_above_camera(projector, level, NEAR), projector_place(), atol=1e-6)
    assert turns_at_axis(projector) == pytest.approx(9.3, abs=1e-9)
    tilt = np.arctan2(170.0, 620.0)
    forward = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    beside = projector_place() + 500.0 * forward + np.array([100.0, 0.0, 0.0])
    assert squared_tangent(projector, projector_place(), beside) == pytest.approx(0.04)
    u, v, first_rate, rate = slide_tangents(projector, first, projector_place(), beside[None])
    assert abs(u[0]) == pytest.approx(0.2)
    assert v[0] == pytest.approx(0.0, abs=1e-9)
    assert rate == pytest.approx(2 * np.pi * 13.0 / 0.42)
    assert u[0] * first_rate == pytest.approx(2 * np.pi * 30.0 * 0.2)


@pytest.mark.parametrize("radial", [0.06, -0.06, 0.0])
def test_undone_at_every_pixel(radial: float) -> None:
    camera, projector = camera_at(), projector_above()
    points = see_relief(camera, projector).points
    lens = Lens(radial, projector_place())
    seen = phase_through_lens(projector, lens, points)
    origin, direction = rays_of_camera(camera, pixel_grid(HEIGHT, WIDTH))
    plain = phase_without_lens(origin, direction, seen, projector, lens)
    assert (np.abs(seen - plain).max() > 0.1) == (radial != 0)
    np.testing.assert_allclose(triangulate(origin, direction, plain, projector).points, points, atol=2e-4)


def calibrated(camera_radial: float, projector_radial: float, seed: int) -> tuple[LensFits, float, float]:
    """The lenses found, and the rms depth error of another surface with and without the projector's term."""
    rng = np.random.default_rng(seed)
    camera, projector, target = camera_at(radial=camera_radial), projector_above(), roof_target()
    lens, roof = Lens(projector_radial, projector_place()), fit_roof(target)
    pixels = pixel_grid(HEIGHT, WIDTH, step=6).reshape(-1, 2)
    phase = phase_through_lens(projector, lens, points_on_roof(camera, roof, pixels)[0])
    phase += rng.normal(0, 0.015, phase.shape)
    seen = marks_in_image(camera) + rng.normal(0, 0.02, (18, 2))
    plain = fit_camera(target, seen, centre=camera.centre)
    start = fit_projector(points_on_roof(plain.camera, roof, pixels)[0], phase, gate=1e3).matrix
    scan = see_relief(camera, projector)
    scan_phase = phase_through_lens(projector, lens, scan.points)
    errors, found = [], []
    for known in (lens._replace(radial=0.0), None):
        fit = fit_radial(
            target, seen, roof, pixels, phase, start, centre=camera.centre, start=plain.camera.radial,
            significance=4.0, projector_lens=known,
        )  # fmt: skip
        own = NO_LENS if known is None else lens._replace(radial=fit.projector_radial)
        points, _ = points_on_roof(fit.camera.camera, roof, pixels)
        matrix = fit_projector(points, phase, gate=1e3, lens=own).matrix
        origin, direction = rays_of_camera(fit.camera.camera, pixel_grid(HEIGHT, WIDTH))
        straight = phase_without_lens(origin, direction, scan_phase, matrix, own)
        depth = triangulate(origin, direction, straight, matrix).points[..., 2]
        errors.append(float(np.sqrt(np.mean((depth - scan.points[..., 2]) ** 2))))
        found.append(fit)
    return found[0], errors[0], errors[1]


@pytest.mark.parametrize("camera_radial", [0.0, ONE_PERCENT_IN_THE_CAMERA])
@pytest.mark.parametrize("projector_radial", [0.0, ONE_PERCENT_IN_THE_PROJECTOR, -ONE_PERCENT_IN_THE_PROJECTOR])
def test_each_lens_gets_its_own_distortion(camera_radial: float, projector_radial: float) -> None:
    fit, with_term, without = calibrated(camera_radial, projector_radial, seed=4)
    if projector_radial == 0.0:
        assert fit.projector_radial == 0.0
        assert with_term == pytest.approx(without, rel=0.02)
    else:
        std = np.sqrt(fit.covariance[1, 1])
        assert abs(fit.projector_radial - projector_radial) < 3.0 * std
        assert 0.0 < std < 0.3 * abs(projector_radial)
        assert with_term < without
    if camera_radial == 0.0:
        assert fit.camera.camera.radial == 0.0
    else:
        assert abs(fit.camera.camera.radial - camera_radial) < 3.5 * np.sqrt(fit.covariance[0, 0])
    assert 0.005 < with_term < 0.15
