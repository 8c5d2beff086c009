"""A 12-bit sensor's stills, written with 16 bits, are saturated at their own top code."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from rahas.stores.images import ImageFolder
from rahas.stores.sample_depth import depth_of_samples


def stills(folder: Path, scale: int, *, highest: int) -> list[np.ndarray]:
    """Twelve stills of a brightening scene of 12-bit codes times ``scale``, cut at ``highest``."""
    folder.mkdir()
    rng = np.random.default_rng(4)
    codes = [np.minimum(rng.integers(0, 60, (40, 60)) + 600 * n, highest).astype(np.uint16) for n in range(12)]
    for n, picture in enumerate(codes):
        cv2.imwrite(str(folder / f"{n:03}.png"), picture * np.uint16(scale))
    return codes


@pytest.mark.parametrize(
    ("scale", "highest", "bits", "factor"),
    [(16, 4095, 12, 1), (16, 3000, 12, 1), (1, 4095, 12, 1), (1, 3000, 16, 1), (5, 4095, 16, 5)],
    ids=["upper bits", "upper bits, unsaturated", "lower bits", "lower bits, unsaturated", "truly 16 bit"],
)
def test_top_code_of_stills(tmp_path: Path, scale: int, highest: int, bits: int, factor: int) -> None:
    codes = stills(tmp_path / "shot", scale, highest=highest)
    folder = ImageFolder(tmp_path / "shot", max_pixels=10_000, frame_rate=30.0)
    frames = list(folder.frames())
    assert folder.facts().bit_depth == bits
    for frame, code in zip(frames, codes, strict=True):
        np.testing.assert_array_equal(frame, code * np.uint16(factor))


def test_darkness_says_nothing() -> None:
    assert depth_of_samples([np.zeros((4, 5), np.uint16)]) == (16, 0)
