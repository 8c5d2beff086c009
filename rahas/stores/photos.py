"""Photos of the texture camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from rahas.errors import CaptureProblem
from rahas.typing import ByteArray


def read_photo(path: Path) -> ByteArray:
    """Read a photo as (y, x, 3) red, green, blue, 8 bit, as the sensor saw it: a turn noted in the file is not applied.

    Raises
    ------
    CaptureProblem
        (rule ``unreadable``) The file is no picture, or its end is missing.
    """
    picture = None
    try:
        data = np.fromfile(path, dtype=np.uint8)
        if data.size:
            picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    except (OSError, cv2.error):
        picture = None
    if picture is None or picture.ndim not in (2, 3):
        raise CaptureProblem(
            "unreadable",
            "texture",
            f"The texture photo {path.name} cannot be read: copy it from the camera's card again, or clear the column "
            "texture to colour the cloud from the video.",
            value=path.name,
            limit="a photo",
        )
    if picture.dtype == np.uint16:
        picture = np.right_shift(picture, 8).astype(np.uint8)
    elif picture.dtype != np.uint8:
        picture = np.clip(np.nan_to_num(picture) * 255.0, 0, 255).astype(np.uint8)
    if picture.ndim == 2 or picture.shape[2] == 1:
        return np.repeat(picture.reshape(*picture.shape[:2], 1), 3, axis=2)
    return np.ascontiguousarray(picture[..., 2::-1])
