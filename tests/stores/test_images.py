"""Photos and folders of stills: every bit, upright, in natural order, and a reason for what cannot be read."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rahas.errors import CaptureProblem
from rahas.params import IngestParams
from rahas.stores.capture import open_capture
from rahas.stores.images import PictureUnreadable, natural_key, read_photo

PARAMS = IngestParams(frame_rate=25.0)


def picture(seed: int = 0, shape: tuple[int, ...] = (24, 32), dtype: type = np.uint8) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, np.iinfo(dtype).max + 1, shape, dtype=dtype)


@pytest.mark.parametrize("suffix", ["png", "tif", "tiff", "PNG"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_folder_of_stills_comes_back_to_the_bit(tmp_path: Path, suffix: str, dtype: type) -> None:
    for n in range(12):
        cv2.imwrite(str(tmp_path / f"IMG{n}.{suffix}"), picture(n, dtype=dtype))
    (tmp_path / "notes.txt").write_text("rain")
    (tmp_path / "._IMG0.png").write_bytes(b"left by a Mac")
    folder = open_capture(tmp_path, PARAMS)
    frames = [frame.copy() for frame in folder.frames()]
    facts = folder.facts()
    for n, frame in enumerate(frames):
        np.testing.assert_array_equal(frame, picture(n, dtype=dtype))
    assert (len(frames), facts.bit_depth, facts.damage) == (12, np.dtype(dtype).itemsize * 8, [])
    np.testing.assert_allclose(facts.time_s, np.arange(12) / 25)


def test_colour_stills_give_luma(tmp_path: Path) -> None:
    for n in range(3):
        Image.fromarray(np.full((16, 16, 3), (200, 100, 50), np.uint8)).save(tmp_path / f"{n}.jpg", quality=100)
    (frame, *_) = open_capture(tmp_path, PARAMS).frames()
    assert float(frame.mean()) == pytest.approx(0.299 * 200 + 0.587 * 100 + 0.114 * 50, abs=1.5)


def test_stills_of_two_sizes_are_refused(tmp_path: Path) -> None:
    for n, shape in enumerate([(24, 32), (24, 32), (32, 24)]):
        cv2.imwrite(str(tmp_path / f"{n}.png"), picture(n, shape))
    with pytest.raises(CaptureProblem, match=r"2\.png has 24 x 32 pixels") as caught:
        list(open_capture(tmp_path, PARAMS).frames())
    assert (caught.value.rule, caught.value.metric) == ("unreadable", "frame_size")


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_a_broken_still_is_left_out_and_named(tmp_path: Path, suffix: str) -> None:
    for n in range(6):
        cv2.imwrite(str(tmp_path / f"{n}.{suffix}"), picture(n))
    broken = tmp_path / f"3.{suffix}"
    broken.write_bytes(broken.read_bytes()[:-200])
    folder = open_capture(tmp_path, PARAMS)
    assert len(list(folder.frames())) == 5
    (entry,) = folder.facts().damage
    assert (entry["kind"], entry["frame"], entry["last_frame"]) == ("missing_frames", 2, 3)
    assert broken.name in entry["message"]


def test_folders_without_one_picture(tmp_path: Path) -> None:
    with pytest.raises(CaptureProblem, match="holds no pictures"):
        open_capture(tmp_path, PARAMS)
    (tmp_path / "a.png").write_text("not a picture")
    with pytest.raises(CaptureProblem, match="None of the 1 pictures") as caught:
        list(open_capture(tmp_path, PARAMS).frames())
    assert caught.value.rule == "unreadable"


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied(tmp_path: Path, orientation: int) -> None:
    seen = np.zeros((40, 60, 3), np.uint8)
    seen[:20, :30], seen[:20, 30:], seen[20:, :30] = (250, 0, 0), (0, 250, 0), (0, 0, 250)
    image = Image.fromarray(seen)
    stored = {
        **{
            1: image,
            2: image.transpose(Image.Transpose.FLIP_LEFT_RIGHT),
            3: image.transpose(Image.Transpose.ROTATE_180),
        },
        **{4: image.transpose(Image.Transpose.FLIP_TOP_BOTTOM), 5: image.transpose(Image.Transpose.TRANSPOSE)},
        **{6: image.transpose(Image.Transpose.ROTATE_90), 7: image.transpose(Image.Transpose.TRANSVERSE)},
        **{8: image.transpose(Image.Transpose.ROTATE_270)},
    }[orientation]
    exif = Image.Exif()
    exif[0x0112] = orientation
    stored.save(tmp_path / "photo.jpg", quality=98, exif=exif)
    photo = read_photo(tmp_path / "photo.jpg")
    assert photo.shape == seen.shape
    for row, column in ((10, 15), (10, 45), (30, 15), (30, 45)):
        np.testing.assert_allclose(photo[row, column].astype(int), seen[row, column], atol=12)


def test_photos_keep_16_bit_and_grey_becomes_rgb(tmp_path: Path) -> None:
    rgb = picture(5, (20, 30, 3), np.uint16)
    cv2.imwrite(str(tmp_path / "deep.tif"), rgb[..., ::-1])
    np.testing.assert_array_equal(read_photo(tmp_path / "deep.tif"), rgb)
    cv2.imwrite(str(tmp_path / "grey.png"), picture(6))
    np.testing.assert_array_equal(read_photo(tmp_path / "grey.png"), np.repeat(picture(6)[..., None], 3, axis=2))


def test_photos_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(PictureUnreadable, match="no picture"):
        read_photo(tmp_path / "gone.png")
    (tmp_path / "text.jpg").write_text("hello")
    with pytest.raises(PictureUnreadable, match="no picture"):
        read_photo(tmp_path / "text.jpg")
    cv2.imwrite(str(tmp_path / "large.png"), picture(1))
    with pytest.raises(PictureUnreadable, match="megapixels"):
        read_photo(tmp_path / "large.png", max_pixels=100)


@given(numbers=st.lists(st.integers(0, 10**9), unique=True, max_size=20), padding=st.integers(0, 6))
def test_natural_order_is_the_order_of_the_numbers(numbers: list[int], padding: int) -> None:
    names = [f"Frame {n:0{padding}d} (copy).png" for n in numbers]
    assert sorted(names, key=natural_key) == [f"Frame {n:0{padding}d} (copy).png" for n in sorted(numbers)]
