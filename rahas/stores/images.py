"""Still pictures: the texture camera's photo, and captures that are folders of stills.

OpenCV reads the samples (16 bit stay 16 bit, nothing is turned); Pillow tells the EXIF orientation, applied here.
"""

from __future__ import annotations

import re
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from rahas.stores.capture import CaptureFacts, even_times, unreadable
from rahas.stores.captures import PICTURE_SUFFIXES
from rahas.stores.sample_depth import depth_of_samples
from rahas.typing import AnyArray

_ORIENTATION = 0x0112
_LOOKED_AT = 9  # stills, for how many bits their samples have
_PNG = b"\x89PNG\r\n\x1a\n"


class PictureUnreadable(ValueError):
    """No picture, or one that is cut short or broken; the message says which."""


def read_photo(path: Path, *, max_pixels: int = 400_000_000) -> AnyArray:
    """A photo as it was seen: (y, x, channel) red, green, blue, uint8 or uint16, upright by its EXIF orientation.

    Raises
    ------
    PictureUnreadable
        The file is missing, broken, no picture, or larger than ``max_pixels``.
    """
    picture = _read_picture(path, max_pixels)
    if picture.ndim == 2:
        return np.repeat(picture[..., None], 3, axis=2)
    return np.ascontiguousarray(picture[..., 2::-1])


def natural_key(name: str) -> tuple[Any, ...]:
    """Sorts frame2 before frame10, whatever the case; the plain name decides between equals."""
    parts = re.split(r"(\d+)", name.casefold())
    return tuple((1, int(part), "") if part.isdecimal() else (0, 0, part) for part in parts), name


class ImageFolder:
    """A folder of PNG, TIFF or JPEG stills being read as a capture, in the natural order of their names."""

    def __init__(self, path: Path, *, max_pixels: int, frame_rate: float) -> None:
        self._path = path
        self._max_pixels = max_pixels
        self._rate = frame_rate
        files = [p for p in path.iterdir() if p.suffix.lower() in PICTURE_SUFFIXES and not p.name.startswith(".")]
        self._files = sorted(files, key=lambda p: natural_key(p.name))
        self._damage: list[dict[str, Any]] = []
        self._count = 0
        self.bit_depth = 8
        if not self._files:
            raise unreadable(
                "empty",
                f"The folder {path.name} holds no pictures (PNG, TIFF or JPEG). Copy the capture's stills into it, or "
                "name another one in the column capture of the field log.",
            )

    def frames(self) -> Iterator[AnyArray]:
        """Luma of each still; one that cannot be read is left out and told of in the damage.

        Raises
        ------
        CaptureProblem
            (rule ``unreadable``) The stills differ in size or depth, or none can be read.
        """
        shape: tuple[int, ...] | None = None
        shift = 0
        for file in self._files:
            try:
                picture = _read_picture(file, self._max_pixels)
            except PictureUnreadable as error:
                self._blame(str(error))
                continue
            word = 8 * picture.dtype.itemsize
            if shape is None:
                first, first_word, self.bit_depth = file.name, word, word
                if word == 16:
                    self.bit_depth, shift = depth_of_samples(self._some())
            luma = _luma(picture >> shift if shift else picture)
            if shape is None:
                shape = luma.shape
            elif luma.shape != shape or word != first_word:
                sizes = _size(shape, first_word), _size(luma.shape, word)
                raise unreadable(
                    "frame_size",
                    f"The pictures of the folder {self._path.name} are not of one kind: {first} has {sizes[0]}, "
                    f"{file.name} has {sizes[1]}. Keep only one capture's stills in it.",
                )
            self._count += 1
            yield luma
        if not self._count:
            raise unreadable(
                "frames",
                f"None of the {len(self._files)} pictures in the folder {self._path.name} can be read: "
                f"{self._damage[0]['message']} Copy them again from the camera's card.",
                value=0,
                limit=1,
                unit="frames",
            )

    def _some(self) -> Iterator[AnyArray]:
        """A few 16-bit stills from all over the capture: lit ones among them."""
        for place in np.unique(np.linspace(0, len(self._files) - 1, _LOOKED_AT).astype(int)):
            try:
                picture = _read_picture(self._files[place], self._max_pixels)
            except PictureUnreadable:
                continue
            if picture.dtype == np.uint16:
                yield picture

    def facts(self) -> CaptureFacts:
        return CaptureFacts(
            time_s=even_times(self._count, self._rate),
            frame_rate=self._rate,
            codec=self._files[0].suffix.lower().lstrip("."),
            bit_depth=self.bit_depth,
            flagged_order="progressive",
            luma_range="full",
            damage=self._damage,
            declared_frames=len(self._files),
        )

    def _blame(self, message: str) -> None:
        place = max(0, self._count - 1)
        self._damage.append(
            {"kind": "missing_frames", "frame": place, "last_frame": place + 1, "message": f"{message}."}
        )


def _size(shape: tuple[int, ...], bits: int) -> str:
    return f"{shape[1]} x {shape[0]} pixels of {bits} bit"


def _luma(picture: AnyArray) -> AnyArray:
    if picture.ndim == 2:
        return picture
    return cv2.cvtColor(np.ascontiguousarray(picture[..., :3]), cv2.COLOR_BGR2GRAY)


def _read_picture(path: Path, max_pixels: int) -> AnyArray:
    """(y, x) or (y, x, blue green red …), uint8 or uint16, upright."""
    if not path.is_file():
        raise PictureUnreadable(f"there is no picture {path.name}")
    orientation = _header(path, max_pixels)
    data = path.read_bytes()
    if fault := _cut_short(data):
        raise PictureUnreadable(f"{path.name} {fault}")
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise PictureUnreadable(f"{path.name} cannot be decoded ({error.err})") from None
    if picture is None:
        raise PictureUnreadable(f"{path.name} cannot be decoded")
    if picture.dtype not in (np.uint8, np.uint16):
        raise PictureUnreadable(f"{path.name} has samples of the type {picture.dtype}; expected 8 or 16 bit")
    if picture.ndim == 3 and picture.shape[2] in (1, 2):
        picture = picture[..., 0]
    return _turned(picture, orientation)


def _header(path: Path, max_pixels: int) -> int:
    """The EXIF orientation (1 to 8), after a look at the size that decoding would take."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path) as image:
                width, height = image.size
                orientation = image.getexif().get(_ORIENTATION, 1)
    except Image.DecompressionBombError:
        raise PictureUnreadable(f"{path.name} says that it is larger than any camera's picture") from None
    except Exception as error:  # Pillow raises whatever a broken header leads to
        raise PictureUnreadable(f"{path.name} is no picture ({type(error).__name__})") from None
    if width * height > max_pixels:
        raise PictureUnreadable(
            f"{path.name} says that it has {width} x {height} pixels, more than {max_pixels / 1e6:g} megapixels"
        )
    return orientation if orientation in range(1, 9) else 1


def _cut_short(data: bytes) -> str:
    """What shows that a picture is not whole; readers fill the rest with grey and say nothing."""
    if data[:3] == b"\xff\xd8\xff":
        return "" if data.rfind(b"\xff\xd9") > data.find(b"\xff\xda") > 0 else "is cut short (no end of a JPEG picture)"
    if data[:8] != _PNG:
        return ""
    here = 8
    while here + 12 <= len(data):
        length, name = int.from_bytes(data[here : here + 4], "big"), data[here + 4 : here + 8]
        stop = here + 8 + length
        if stop + 4 > len(data):
            break
        if zlib.crc32(memoryview(data)[here + 4 : stop]) != int.from_bytes(data[stop : stop + 4], "big"):
            return "is broken (a checksum does not fit)"
        if name == b"IEND":
            return ""
        here = stop + 4
    return "is cut short (no end of a PNG picture)"


def _turned(picture: AnyArray, orientation: int) -> AnyArray:
    """Apply an EXIF orientation: 2, 4, 5, 7 mirrored; 3 upside down; 6 and 8 a quarter turn."""
    mirrored = {2: 0, 4: 2, 5: 1, 7: 3}
    turns = {1: 0, 3: 2, 6: 3, 8: 1}
    if orientation in mirrored:
        return np.rot90(picture[:, ::-1], mirrored[orientation])
    return np.rot90(picture, turns[orientation])
