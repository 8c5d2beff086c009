"""Photos of any kind come as 8-bit red, green, blue; a broken one is a finding."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.stores.photos import read_texture


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_channels_and_depth(tmp_path: Path, depth: type) -> None:
    full = np.iinfo(depth).max
    picture = np.zeros((5, 8, 3), depth)
    picture[..., 2] = full  # OpenCV's order: red last
    path = tmp_path / "phötö.png"
    cv2.imencode(".png", picture)[1].tofile(path)
    read = read_texture(path)
    assert read.dtype == np.uint8
    assert read.shape == (5, 8, 3)
    assert read[2, 3].tolist() == [255, 0, 0]


def test_grey_and_alpha(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((4, 5), 77, np.uint8))
    assert read_texture(tmp_path / "grey.png")[1, 1].tolist() == [77, 77, 77]
    cv2.imwrite(str(tmp_path / "alpha.png"), np.full((4, 5, 4), (10, 20, 30, 0), np.uint8))
    assert read_texture(tmp_path / "alpha.png")[1, 1].tolist() == [30, 20, 10]


def test_no_picture(tmp_path: Path) -> None:
    for name, content in (("text.jpg", b"not a picture"), ("empty.jpg", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CaptureProblem, match="cannot be read"):
            read_texture(tmp_path / name)
