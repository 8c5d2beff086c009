"""Camera matrices and radial distortion come back from the marks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rahas.kernels.camera import camera_matrix_from_marks, distort, fit_camera, project, undistort
from tests.roof_scene import camera_at, marks_in_image, roof_target


@given(st.floats(-30, 30), st.floats(-20, 20), st.floats(-20, 20), st.floats(0.8, 3.0))
def test_direct_linear_transform_is_exact(turn: float, yaw: float, pitch: float, focal: float) -> None:
    camera = camera_at(turn_deg=turn, yaw_deg=yaw, pitch_deg=pitch, focal=focal)
    matrix = camera_matrix_from_marks(roof_target(), marks_in_image(camera))
    assert matrix[2, 3] == 1.0
    np.testing.assert_allclose(matrix, camera.matrix, rtol=1e-6, atol=1e-8)


@given(st.floats(-8e-7, 8e-7), st.floats(0, 359), st.floats(0, 239))
def test_undistort_undoes_distort(radial: float, x: float, y: float) -> None:
    centre = np.array([179.5, 119.5])
    there = distort(np.array([[x, y]]), radial=radial, centre=centre)
    np.testing.assert_allclose(undistort(there, radial=radial, centre=centre), [[x, y]], atol=1e-6)


def test_points_on_one_plane_are_refused() -> None:
    flat = roof_target() * [1, 1, 0]
    with pytest.raises(ValueError, match="one plane"):
        camera_matrix_from_marks(flat, marks_in_image(camera_at()))


def test_radial_is_fitted_only_where_it_shows() -> None:
    rng = np.random.default_rng(3)
    target = roof_target()
    fitted = 0
    for _ in range(20):
        straight = camera_at()
        pixels = marks_in_image(straight) + rng.normal(0, 0.03, (18, 2))
        fitted += fit_camera(target, pixels, centre=straight.centre).camera.radial != 0.0
    assert fitted <= 1
    bent = camera_at(radial=-1e-6)
    fits = [
        fit_camera(target, marks_in_image(bent) + rng.normal(0, 0.03, (18, 2)), centre=bent.centre) for _ in range(30)
    ]
    radial = np.array([fit.camera.radial for fit in fits])
    assert np.mean(radial != 0) > 0.9
    assert abs(np.mean(radial[radial != 0]) / -1e-6 - 1) < 0.15
    predicted = np.median([np.sqrt(fit.covariance[11, 11]) for fit in fits])
    assert 0.5 < np.std(radial[radial != 0]) / predicted < 2.0


def test_residuals_and_covariance_match_the_noise() -> None:
    rng = np.random.default_rng(4)
    camera, target = camera_at(), roof_target()
    place = np.array([[30.0, -60.0, 40.0]])
    fits = [
        fit_camera(target, marks_in_image(camera) + rng.normal(0, 0.05, (18, 2)), centre=camera.centre)
        for _ in range(60)
    ]
    assert 0.04 < np.mean([fit.sigma_px for fit in fits]) < 0.06
    seen = np.array([project(fit.camera, place)[0] for fit in fits])
    assert np.std(seen) < 30
    assert np.abs(np.mean(seen, axis=0) - project(camera, place)[0]).max() < 0.1
