"""A scan of the target gives the rig back; a bad one is refused with its reason."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.kernels.camera import project
from rahas.kernels.projector import phase_of_projector
from rahas.params import CalibrationParams
from rahas.stages.calibrate import Calibration, calibrate
from rahas.stages.rig import rig_from_json
from rahas.stages.sighting import Target
from tests.roof_scene import RADIUS_MM, Scene, camera_at, projector_above, roof_target, see_roof

CAMERA, PROJECTOR = camera_at(radial=-1.5e-7), projector_above()
PHOTO_CAMERA = camera_at(width=540, height=360, yaw_deg=-2.0, shift_mm=(12.0, 4.0))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return see_roof(CAMERA, PROJECTOR)


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    return see_roof(PHOTO_CAMERA, PROJECTOR, width=540, height=360).image


def table(**changes: np.ndarray) -> Target:
    return Target(np.arange(1, 19), roof_target(), np.full(18, np.nan))._replace(**changes)


def run(
    scene: Scene, *, noise: float = 0.02, target: Target | None = None, photo: np.ndarray | None = None
) -> Calibration:
    rng = np.random.default_rng(3)
    stripes_left = np.cos(np.nan_to_num(scene.unwrapped_phase))
    image = cv2.GaussianBlur(scene.image, (0, 0), 0.7) * (1 + 0.1 * stripes_left)
    phase = scene.unwrapped_phase + rng.normal(0, noise, scene.image.shape)
    phase[scene.image < 100] = np.nan
    phase += 0.03 * np.cos(phase)
    return calibrate(
        background=(image + rng.normal(0, 0.5, image.shape)).astype(np.float32),
        unwrapped_phase=phase.astype(np.float32),
        target=target or table(),
        photo=photo,
        params=CalibrationParams(),
    )


def test_rig_comes_back(scene: Scene, photo: np.ndarray) -> None:
    result = run(scene, photo=photo)
    assert result.warnings == []
    assert result.residuals["marks_found"] == 18
    assert 0.001 < result.residuals["camera_rms_px"] < 0.15
    assert 0.02 < result.residuals["projector_rms_rad"] < 0.045
    # blur of σ px draws a round edge of radius R in by σ²/2R: here about 0.1 px, 0.13 mm
    assert abs(result.residuals["mark_radius_mm"] - RADIUS_MM) < 0.2
    places = np.random.default_rng(1).uniform([-60, -130, -40], [120, 20, 30], (200, 3))
    rig = result.rig
    assert np.abs(project(rig.camera.camera, places) - project(CAMERA, places)).max() < 0.3
    assert np.abs(phase_of_projector(rig.projector, places) - phase_of_projector(PROJECTOR, places)).max() < 0.05
    assert rig.texture_camera is not None
    assert np.abs(project(rig.texture_camera.camera, places) - project(PHOTO_CAMERA, places)).max() < 0.5
    assert [mark["mark"] for mark in result.marks] == list(range(1, 19))
    truth = phase_of_projector(PROJECTOR, roof_target())
    assert np.abs([m["unwrapped_phase"] - p for m, p in zip(result.marks, truth, strict=True)]).max() < 0.1


def test_json_is_finite_and_reads_back(scene: Scene, photo: np.ndarray) -> None:
    result = run(scene, photo=photo)
    rig = rig_from_json(json.loads(json.dumps(result.as_json(), allow_nan=False)))
    np.testing.assert_array_equal(rig.projector, result.rig.projector)
    np.testing.assert_array_equal(rig.camera.camera.matrix, result.rig.camera.camera.matrix)
    assert rig.covariance.shape == (20, 20)
    assert np.linalg.eigvalsh(rig.covariance / np.outer(*[np.sqrt(np.diag(rig.covariance)) + 1e-30] * 2)).min() > -1e-6


def test_rows_of_the_table_in_any_order(scene: Scene) -> None:
    order = np.random.default_rng(2).permutation(18)
    plain = run(scene)
    mixed = run(scene, target=table(mark=order + 1, world=roof_target()[order]))
    np.testing.assert_allclose(mixed.rig.projector, plain.rig.projector, rtol=1e-4, atol=1e-7)
    assert [m["mark"] for m in mixed.marks] == list(range(1, 19))
    np.testing.assert_allclose([m["x_px"] for m in mixed.marks], [m["x_px"] for m in plain.marks], atol=0.01)


def test_photo_that_is_turned_is_recognised(scene: Scene, photo: np.ndarray) -> None:
    result = run(scene, photo=np.rot90(photo))
    assert result.rig.texture_camera is not None
    assert (result.rig.texture_camera.width_px, result.rig.texture_camera.height_px) == (360, 540)


def test_photo_without_target_costs_the_colour_only(scene: Scene) -> None:
    result = run(scene, photo=np.full((300, 400), 90.0))
    assert result.rig.texture_camera is None
    assert len(result.warnings) == 1


def test_no_target_in_view(scene: Scene) -> None:
    with pytest.raises(CaptureProblem, match="marks were recognised") as problem:
        run(scene._replace(image=np.full(scene.image.shape, 120.0)))
    assert (problem.value.rule, problem.value.metric, problem.value.value) == ("calibration", "marks_found", 0)


def test_wrong_table_is_refused(scene: Scene) -> None:
    wrong = roof_target()
    wrong[3:6, 0] -= 6.0
    with pytest.raises(CaptureProblem) as problem:
        run(scene, target=table(world=wrong))
    assert problem.value.rule == "calibration"
    assert problem.value.metric in ("camera_rms_px", "target_flatness_mm", "marks_found")


def test_phase_that_is_no_roof_is_refused(scene: Scene) -> None:
    y, x = np.mgrid[0:240, 0:360]
    curled = scene._replace(unwrapped_phase=scene.unwrapped_phase + 2.5 * np.sin(x / 9.0) * np.sin(y / 11.0))
    with pytest.raises(CaptureProblem) as problem:
        run(curled)
    assert problem.value.metric in ("projector_rms_mm", "projector_inlier_share")
    with pytest.raises(CaptureProblem) as problem:
        run(scene._replace(unwrapped_phase=np.full((240, 360), np.nan)))
    assert problem.value.metric == "projector_points"
