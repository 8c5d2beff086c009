"""Displacement of the object under moving stripes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rahas.kernels.jitter import displacement_from_texture, jitter_from_displacement, template_from_texture
from rahas.kernels.texture import TextureFrame, high_pass_sigma, texture_from_luma
from tests.qa.scene import fractal

HEIGHT, WIDTH, PITCH = 200, 300, 24.0


def textured(luma: np.ndarray) -> TextureFrame:
    return texture_from_luma(luma, black_level=0.0, offset=10.0, sigma=high_pass_sigma(PITCH))


def shown(x: float, y: float, *, step: float | None, angle: float = 1.2, seed: int = 3) -> np.ndarray:
    """The object displaced by (x, y) under stripes that stay; without stripes if ``step`` is None."""
    albedo = np.exp(0.12 * fractal(HEIGHT + 80, WIDTH + 80, seed=seed)).astype(np.float32)
    move = np.array([[1, 0, x - 40], [0, 1, y - 40]], np.float32)
    still = 50.0 * cv2.warpAffine(albedo, move, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)
    if step is None:
        return still
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    along = column * np.cos(angle) + row * np.sin(angle)
    light = 1.0 + 0.9 * np.cos(2 * np.pi * along / PITCH + step)
    noise = np.random.default_rng(int(100 * (step + 10))).standard_normal(still.shape)
    return np.round(still * light + 1.5 * noise)


@pytest.mark.parametrize("true", [(0.0, 0.0), (0.3, -0.4), (-1.6, 0.7), (4.3, 2.2), (-9.2, 12.4)])
def test_displacement_is_the_objects_and_not_the_stripes(true: tuple[float, float]) -> None:
    template = template_from_texture(textured(shown(0, 0, step=None)), np.ones((HEIGHT, WIDTH), bool))
    for step in (0.0, 1.7, 3.4, 5.1):
        found = displacement_from_texture(template, textured(shown(*true, step=step)))
        assert found is not None
        assert (found.x, found.y) == pytest.approx(true, abs=0.10)
        assert found.scale == pytest.approx(1.0, abs=0.15)
        assert 0.0 < found.std < 0.10


def test_another_object_is_not_found() -> None:
    template = template_from_texture(textured(shown(0, 0, step=None)), np.ones((HEIGHT, WIDTH), bool))
    found = [displacement_from_texture(template, textured(shown(0, 0, step=s, seed=9))) for s in (0.0, 2.0, 4.0)]
    assert found == [None, None, None]


def test_jitter_is_the_worst_second() -> None:
    time_s = np.arange(150) / 30
    swing = np.zeros((150, 2))
    calm = jitter_from_displacement(swing, time_s)
    swing[60:90, 0] = 2.0 * np.cos(2 * np.pi * 6 * time_s[60:90])
    swing[60:90, 1] = 1.0 * np.sin(2 * np.pi * 6 * time_s[60:90])
    assert calm == 0.0
    assert jitter_from_displacement(swing, time_s) == pytest.approx(np.sqrt((4 + 1) / 2), rel=0.02)
    assert jitter_from_displacement(swing + 100.0, time_s) == pytest.approx(np.sqrt(2.5), rel=0.02)


def test_frames_without_displacement_are_left_out_of_the_jitter() -> None:
    time_s = np.arange(90) / 30
    swing = np.stack([np.cos(2 * np.pi * 6.7 * time_s), 0 * time_s], axis=1)
    swing[::3] = np.nan
    assert jitter_from_displacement(swing, time_s) == pytest.approx(np.sqrt(0.5), rel=0.10)
    assert jitter_from_displacement(np.full((90, 2), np.nan), time_s) is None
    assert jitter_from_displacement(np.zeros((10, 2)), time_s[:10]) == 0.0
