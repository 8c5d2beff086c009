"""First half of the renderer: rays, slide coordinates, light, and the matrices that sum them up."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.simulate.capture import photo, stage
from rahas.simulate.examples import example
from rahas.simulate.maps import lit_of, maps_of, surface_of
from rahas.simulate.roof import MARK_ALBEDO, target_marks

DISTORTED = {"radial_k1": -0.05, "centre_u": 0.02, "centre_v": 0.01, "second_stop_deg": 90.6, "baseline_tilt_deg": 1.5}


def projected(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    homogeneous = points @ matrix[:, :3].T + matrix[:, 3]
    return homogeneous[..., :-1] / homogeneous[..., -1:]


@pytest.fixture(scope="module")
def roof_staged():
    return stage(example("roof", short=True, rig=DISTORTED))


def test_camera_matrix_and_distortion_bring_each_surface_point_back_to_its_pixel(roof_staged):
    truth, rig = roof_staged.truth(), roof_staged.capture.rig
    ideal = projected(truth["camera_matrix"], truth["world_target"].astype(float))
    middle = np.array([(rig.width_px - 1) / 2, (rig.height_px - 1) / 2])
    slopes = (ideal - middle) / (rig.focal_widths * rig.width_px)
    seen = middle + (ideal - middle) * (1 + rig.radial_k1 * np.sum(slopes**2, axis=-1, keepdims=True))
    pixels = np.stack(np.meshgrid(np.arange(rig.width_px), np.arange(rig.height_px)), axis=-1)
    assert np.abs(seen - pixels).max() < 1e-3
    assert np.abs(ideal - pixels).max() > 0.5, "the distortion asked for must be there"


def test_projector_matrix_gives_the_phase_of_each_surface_point(roof_staged):
    truth = roof_staged.truth()
    periods = projected(truth["projector_matrix"], truth["world_target"].astype(float))[..., 0]
    assert np.abs(2 * np.pi * periods - truth["unwrapped_phase"]).max() < 1e-3


def test_phase_grows_downwards_and_stripes_of_the_first_stop_follow_the_columns(roof_staged):
    truth = roof_staged.truth()
    down = np.diff(truth["unwrapped_phase"], axis=0)
    assert 0.15 < down.min() < down.max() < 0.27  # about 30 px a stripe
    along, across = np.diff(truth["first_phase"], axis=0), np.diff(truth["first_phase"], axis=1)
    assert np.median(np.abs(along)) < 0.05 * np.median(np.abs(across))


@pytest.mark.parametrize(("matrix", "scale"), [("camera_matrix", 1), ("texture_matrix", 3)])
def test_marks_lie_where_the_matrices_put_them(roof_staged, matrix, scale):
    truth = roof_staged.truth()
    picture = truth["albedo"] if scale == 1 else photo(roof_staged).mean(axis=-1)
    dark = picture < 0.6 * np.median(picture)
    radius = 12 * scale
    for x, y in projected(truth[matrix], target_marks()):
        if scale == 1:  # a small shift by the distortion
            x, y = (truth["u"].shape[1] - 1) / 2 + (x - 179.5) * 0.998, y
        rows, columns = np.mgrid[round(y) - radius : round(y) + radius + 1, round(x) - radius : round(x) + radius + 1]
        weight = dark[rows, columns]
        assert 150 * scale**2 < weight.sum() < 300 * scale**2
        assert abs((columns * weight).sum() / weight.sum() - x) < 0.5 * scale
        assert abs((rows * weight).sum() / weight.sum() - y) < 0.5 * scale
    assert truth["albedo"].min() == pytest.approx(MARK_ALBEDO, abs=0.01)


def test_world_of_the_roof_lies_on_its_two_planes(roof_staged):
    world = roof_staged.truth()["world_target"].astype(float)
    marks = target_marks()
    for slope, columns in ((marks[:9], slice(20, 150)), (marks[9:], slice(210, 340))):
        normal = np.cross(slope[1] - slope[0], slope[3] - slope[0])
        off_plane = (world[20:-20, columns] - slope[0]) @ normal / np.linalg.norm(normal)
        assert np.abs(off_plane).max() < 0.02


def test_petroglyph_fills_the_picture_and_is_lit():
    maps = maps_of(capture := example("monkey", short=True), surface_of(capture))
    assert lit_of(maps, capture.rig).mean() > 0.99
    height = maps.points[..., 2]
    assert 10 < np.ptp(height) < 30
    assert 0.03 < maps.albedo.std() / maps.albedo.mean() < 0.35


def test_small_stone_spans_what_it_is_asked_to_and_throws_a_shadow():
    capture = example("metate", short=True, scene={"size_mm": 60.0})
    maps = maps_of(capture, surface_of(capture))
    stone = maps.albedo > 0.1
    assert 0.18 < np.ptp(np.flatnonzero(stone.any(axis=0))) / stone.shape[1] < 0.22
    shadow = ~lit_of(maps, capture.rig)
    assert 20 < shadow.sum() < 0.1 * shadow.size
    rows = np.nonzero(shadow)[0]
    assert rows.mean() > np.nonzero(stone)[0].mean(), "the lamp stands above, so the shadow falls below"


def test_sphere_is_round():
    capture = example("sphere", short=True, scene={"size_mm": 120.0})
    points = maps_of(capture, surface_of(capture)).points
    cap = points[100:141, 150:211].reshape(-1, 3).astype(float)
    system = np.concatenate([2 * cap, np.ones((len(cap), 1))], axis=1)
    centre_and_rest = np.linalg.lstsq(system, (cap**2).sum(axis=1), rcond=None)[0]
    radius = np.sqrt(centre_and_rest[3] + (centre_and_rest[:3] ** 2).sum())
    assert radius == pytest.approx(60.0, abs=0.5)
