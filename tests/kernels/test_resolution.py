"""Sizes grow with the image, and stay what they are at the thesis's 720 × 480."""

from __future__ import annotations

import pytest

from rahas.kernels.resolution import image_scale


@pytest.mark.parametrize(
    ("height", "width", "scale"), [(480, 720, 1.0), (720, 480, 1.0), (240, 360, 1.0), (1080, 1920, 2.25)]
)
def test_scale_is_that_of_the_shorter_side(height: int, width: int, scale: float) -> None:
    assert image_scale(height, width) == scale
