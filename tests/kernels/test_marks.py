"""Marks are found among spots that are none, measured to hundredths of a pixel, and identified."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rahas.kernels.mark_identity import identify_marks
from rahas.kernels.marks import find_marks
from rahas.kernels.roof import centre_shift, fit_roof
from tests.roof_scene import RADIUS_MM, camera_at, marks_in_image, projector_above, roof_target, see_roof


def disturbed(image: np.ndarray, phase: np.ndarray, seed: int) -> np.ndarray:
    """Shading, stripes left over, blur and noise, as in the background of a hand-cranked scan."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    shading = 0.55 + 0.45 * np.cos((x - 150) / 260) * np.cos((y - 90) / 230)
    stripes = 1.0 + 0.2 * np.cos(phase)
    blurred = cv2.GaussianBlur(image * shading * stripes, (0, 0), 0.7)
    return (blurred + rng.normal(0, 0.7, image.shape)).astype(np.float32)


@pytest.mark.parametrize("turn_deg", [-28.0, 0.0, 28.0])
def test_centres_under_shading_stripes_and_noise(turn_deg: float) -> None:
    camera = camera_at(turn_deg=turn_deg, focal=1.15)
    scene = see_roof(camera, projector_above())
    marks = find_marks(disturbed(scene.image, scene.unwrapped_phase, 1))
    identity = identify_marks(marks.centre, marks.semi_axes.mean(axis=1), roof_target())
    assert sorted(identity.mark) == list(range(18))
    roof = fit_roof(roof_target())
    shift = centre_shift(camera, roof_target(), roof.normal[roof.slope], np.full(18, RADIUS_MM))
    error = marks.centre[identity.ellipse] - (marks_in_image(camera) + shift)[identity.mark]
    assert np.sqrt(np.mean(error**2)) < 0.05


def test_centres_are_the_ellipses_own_on_a_clean_image() -> None:
    camera = camera_at()
    scene = see_roof(camera, projector_above())
    marks = find_marks(scene.image)
    roof = fit_roof(roof_target())
    shift = centre_shift(camera, roof_target(), roof.normal[roof.slope], np.full(18, RADIUS_MM))
    distance = np.linalg.norm(marks.centre[:, None] - (marks_in_image(camera) + shift)[None], axis=-1)
    assert len(marks.centre) == 18
    assert distance.min(axis=0).max() < 0.03
    assert np.abs(shift).max() > 0.01, "perspective must matter here, or the correction is not tested"


@pytest.mark.parametrize("hidden", [(0,), (0, 17), (8, 9), (4, 13)])
def test_hidden_marks_and_distractors(hidden: tuple[int, ...]) -> None:
    camera = camera_at(turn_deg=8.0, yaw_deg=-12.0, pitch_deg=9.0, focal=1.2)
    scene = see_roof(camera, projector_above(), hidden=hidden)
    image = scene.image.astype(np.float32)
    rng = np.random.default_rng(7)
    for x, y in ((30, 20), (335, 215), (180, 228), (180, 12), (20, 130), (340, 60)):
        cv2.circle(image, (x, y), int(rng.integers(7, 11)), 20.0, -1, cv2.LINE_AA)
    cv2.rectangle(image, (170, 100), (185, 108), 20.0, -1)
    marks = find_marks(cv2.GaussianBlur(image, (0, 0), 0.8))
    order = rng.permutation(18)
    identity = identify_marks(marks.centre, marks.semi_axes.mean(axis=1), roof_target()[order])
    named = order[identity.mark]
    assert sorted(named) == [i for i in range(18) if i not in hidden]
    error = marks.centre[identity.ellipse] - marks_in_image(camera)[named]
    assert np.abs(error).max() < 0.4


def test_size_of_image_does_not_matter() -> None:
    width, height = 1500, 1000
    camera = camera_at(width=width, height=height)
    target = marks_in_image(camera)
    y, x = np.mgrid[0:height, 0:width]
    dark = np.zeros((height, width))
    for there in target:
        dark += np.clip(26.5 - np.hypot(x - there[0], y - there[1]), 0.0, 1.0)
    marks = find_marks(180.0 - 160.0 * dark)
    distance = np.linalg.norm(marks.centre[:, None] - target[None], axis=-1).min(axis=0)
    assert len(marks.centre) == 18
    assert distance.max() < 0.02


def test_no_target_no_marks() -> None:
    rng = np.random.default_rng(2)
    texture = cv2.GaussianBlur(rng.normal(0, 1, (240, 360)).astype(np.float32), (0, 0), 4)
    image = 100 + 300 * texture
    marks = find_marks(image)
    assert len(identify_marks(marks.centre, marks.semi_axes.mean(axis=1), roof_target()).mark) < 12
    assert len(find_marks(np.full((50, 60), np.nan)).centre) == 0
