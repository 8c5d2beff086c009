"""Phase and rig give the surface back, coloured, cleaned, with an honest uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.kernels.camera import project
from rahas.params import CloudParams
from rahas.stages.cloud import Cloud, make_cloud
from rahas.stages.rig import ImagingCamera, Rig
from tests.roof_scene import HEIGHT, WIDTH, camera_at, projector_above, see_relief

CAMERA, PROJECTOR = camera_at(), projector_above()
PHOTO_CAMERA = camera_at(width=540, height=360, yaw_deg=1.0, focal=1.1)
RIG = Rig(ImagingCamera(CAMERA, WIDTH, HEIGHT), PROJECTOR, ImagingCamera(PHOTO_CAMERA, 540, 360), np.zeros((20, 20)))
SCENE = see_relief(CAMERA, PROJECTOR)


def run(
    phase: np.ndarray, *, std: float = 0.02, rig: Rig = RIG, photo: np.ndarray | None = None, **params: object
) -> Cloud:
    return make_cloud(
        unwrapped_phase=phase.astype(np.float32),
        phase_std=np.full(phase.shape, std, np.float32),
        background=SCENE.image.astype(np.float32),
        rig=rig,
        photo=photo,
        params=CloudParams(**params),
    )


def test_depth_and_its_standard_deviation() -> None:
    noise = np.random.default_rng(1).normal(0, 0.02, SCENE.unwrapped_phase.shape)
    cloud = run(SCENE.unwrapped_phase + noise)
    error = cloud.points - SCENE.points
    assert np.isfinite(error[..., 2]).mean() > 0.99
    pull = error[..., 2] / cloud.z_std
    assert 0.9 < np.nanstd(pull) < 1.1
    assert abs(np.nanmedian(error[..., 2])) < 0.02
    exact = run(SCENE.unwrapped_phase, std=0.001)
    assert np.nanmax(np.abs(exact.points - SCENE.points)) < 0.01


def test_debanding_helps_and_both_clouds_are_kept() -> None:
    rng = np.random.default_rng(2)
    phase = SCENE.unwrapped_phase + 0.08 * np.cos(SCENE.unwrapped_phase) + rng.normal(0, 0.01, SCENE.points.shape[:2])
    cloud = run(phase)
    before = np.nanstd(cloud.points_before_debanding[..., 2] - SCENE.points[..., 2])
    after = np.nanstd(cloud.points[..., 2] - SCENE.points[..., 2])
    assert after < 0.35 * before
    left_alone = run(phase, deband=False)
    np.testing.assert_array_equal(left_alone.points, left_alone.points_before_debanding)
    assert left_alone.debanded.orders_removed == ()


def test_normals_stand_on_the_surface() -> None:
    cloud = run(SCENE.unwrapped_phase, std=0.001)
    across, down = np.gradient(SCENE.points, axis=1), np.gradient(SCENE.points, axis=0)
    truth = np.cross(down, across)
    truth /= np.linalg.norm(truth, axis=-1, keepdims=True)
    truth *= np.sign(truth[..., 2:])
    inner = (slice(4, -4), slice(4, -4))
    angle = np.rad2deg(np.arccos(np.clip(np.sum(cloud.normals * truth, axis=-1), -1, 1)))[inner]
    assert np.nanmedian(angle) < 2.0
    assert np.nanmin(cloud.normals[..., 2]) > 0


def test_colour_is_the_photos_at_the_point() -> None:
    y, x = np.mgrid[0:360, 0:540]
    photo = np.stack([x * 255 // 539, y * 255 // 359, np.full(x.shape, 40)], axis=-1).astype(np.uint8)
    cloud = run(SCENE.unwrapped_phase, photo=photo)
    place = project(PHOTO_CAMERA, SCENE.points)
    inside = np.all((place > 1) & (place < [538, 358]), axis=-1) & np.isfinite(cloud.points[..., 0])
    assert inside.mean() > 0.8
    difference = cloud.colour[inside].astype(float)[:, :2] - place[inside] * [255 / 539, 255 / 359]
    assert np.abs(difference).max() < 2.0
    assert (cloud.colour[inside][:, 2] == 40).all()
    twice = run(SCENE.unwrapped_phase, photo=photo.repeat(2, axis=0).repeat(2, axis=1))
    assert np.abs(twice.colour[inside].astype(int) - cloud.colour[inside]).max() <= 2


def test_grey_where_there_is_no_texture_camera() -> None:
    cloud = run(SCENE.unwrapped_phase, rig=RIG._replace(texture_camera=None), photo=np.zeros((360, 540, 3), np.uint8))
    assert len(cloud.warnings) == 1
    assert (cloud.colour[np.isfinite(cloud.points[..., 0])] == 255).all()
    assert run(SCENE.unwrapped_phase, rig=RIG._replace(texture_camera=None)).warnings == []


def test_wrong_orders_and_noise_are_left_out() -> None:
    phase = SCENE.unwrapped_phase.copy()
    phase[100:106, 200:208] += 2 * np.pi
    phase[50, 60] += 2 * np.pi
    phase[:, :10] = np.nan
    cloud = run(phase)
    assert np.isnan(cloud.points[100:106, 200:208, 2]).all()
    assert np.isnan(cloud.points[50, 60, 2])
    assert np.isnan(cloud.points[:, :10]).all()
    assert np.nanmax(np.abs(cloud.points[..., 2] - SCENE.points[..., 2])) < 0.5
    assert 0.9 < cloud.measured_share < 1.0


def test_calibration_of_another_image_size_is_refused() -> None:
    with pytest.raises(CaptureProblem, match="360 × 240") as problem:
        run(SCENE.unwrapped_phase, rig=RIG._replace(camera=ImagingCamera(CAMERA, 720, 480)))
    assert problem.value.rule == "calibration"
    with pytest.raises(CaptureProblem, match="No surface"):
        run(np.full((HEIGHT, WIDTH), np.nan))
