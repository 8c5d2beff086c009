"""The texture camera's photos, as 8-bit colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rahas.errors import CaptureProblem
from rahas.stores.images import PictureUnreadable, read_photo
from rahas.typing import ByteArray


def read_texture(path: Path) -> ByteArray:
    """Read a photo as (y, x, 3) red, green, blue, 8 bit, upright.

    Raises
    ------
    CaptureProblem
        (rule ``unreadable``) The file is no picture, or its end is missing.
    """
    try:
        picture = read_photo(path)
    except PictureUnreadable as error:
        raise CaptureProblem(
            "unreadable",
            "texture",
            f"The texture photo {path.name} cannot be read ({error}): copy it from the camera's card again, or clear "
            "the column texture to colour the cloud from the video.",
            value=path.name,
            limit="a photo",
        ) from None
    if picture.dtype == np.uint16:
        return np.right_shift(picture, 8).astype(np.uint8)
    return np.asarray(picture, dtype=np.uint8)
