"""The projector matrix comes back from marks and from dense phase, whatever is wrong with some of it."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.projector import fit_projector, phase_at_mark, phase_of_projector
from rahas.kernels.roof import fit_roof
from rahas.kernels.target_phase import fit_projector_on_roof
from tests.roof_scene import RADIUS_MM, camera_at, marks_in_image, projector_above, roof_target, see_roof


def test_marks_alone_give_the_matrix() -> None:
    truth, target = projector_above(), roof_target()
    fit = fit_projector(target, phase_of_projector(truth, target))
    np.testing.assert_allclose(fit.matrix, truth, rtol=1e-5, atol=1e-8)
    with pytest.raises(ValueError, match="projector needs"):
        fit_projector(target[:6], np.zeros(6))


def test_wrong_orders_are_rejected() -> None:
    truth, camera, target = projector_above(), camera_at(), roof_target()
    scene = see_roof(camera, truth)
    rng = np.random.default_rng(1)
    phase = scene.unwrapped_phase + rng.normal(0, 0.02, scene.unwrapped_phase.shape)
    phase[30:90, 100:200] += 2 * np.pi
    phase[:, :20] = np.nan
    phase[170:, 300:] -= 4 * np.pi
    dense = fit_projector_on_roof(
        phase, camera, fit_roof(target), target, mark_radius_mm=RADIUS_MM, margin_mm=15.0, start=None
    )
    error = phase_of_projector(dense.fit.matrix, scene.points) - scene.unwrapped_phase
    assert np.sqrt(np.mean(error**2)) < 0.001
    assert 0.018 < dense.fit.sigma_rad < 0.022
    assert 0.7 < dense.inlier_share < 0.95


def test_phase_at_a_mark_comes_from_around_it() -> None:
    truth, camera = projector_above(), camera_at()
    scene = see_roof(camera, truth)
    phase = scene.unwrapped_phase.copy()
    phase[scene.image < 100] = 1e3  # nonsense in the dark
    centre = marks_in_image(camera)[4]
    usable = np.arange(phase.shape[1])[None, :] < 170
    found = phase_at_mark(phase, centre, np.array([7.5, 7.0]), usable=np.broadcast_to(usable, phase.shape))
    assert abs(found - phase_of_projector(truth, roof_target()[4])) < 0.01
    assert np.isnan(phase_at_mark(np.full((240, 360), np.nan), centre, np.array([7.0, 7.0]), usable=phase < np.inf))
