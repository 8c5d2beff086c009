"""Un-rotation: frames turned so that the stripes lie horizontal in every one of them (thesis 3.4.1, Fig. 3.5).

Canvas      the image's size; it turns about the image's centre ((W−1)/2, (H−1)/2)
Un-rotation angle of the turn in degrees: rotation_sense · (90 − slide angle)
Mapping     a point p of the image (x right, y down, from the centre) is seen on the canvas at R·p,
            R = [[cos, −sin], [sin, cos]](un-rotation)
Columns     the canvas stored (x, y): each canvas column contiguous in memory, as the peak search reads it

The thesis turns frame n by 90°·(N − (n − 1))/N (equation 3.1), which holds for a lever of even speed; here the
angle of each frame is measured.
"""

from __future__ import annotations

import cv2
import numpy as np

from rahas.typing import AnyArray, FloatArray


def unrotation_deg_from_slide_angle(slide_angle_deg: FloatArray, *, rotation_sense: int) -> FloatArray:
    """Un-rotation of each frame in degrees; NaN where the slide angle is unknown.

    >>> unrotation_deg_from_slide_angle(np.array([0.0, 30.0, 90.0]), rotation_sense=-1)
    array([-90., -60.,  -0.])
    """
    if rotation_sense not in (-1, 1):
        raise ValueError(f"{rotation_sense = }, expected -1 or +1")
    return rotation_sense * (90.0 - np.asarray(slide_angle_deg, dtype=np.float64))


def canvas_matrix(unrotation_deg: float, *, height: int, width: int) -> FloatArray:
    """The 2 × 3 matrix that takes an image point (x, y, 1) to the canvas; pixel centres are integers."""
    angle = np.deg2rad(unrotation_deg)
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    centre = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    return np.column_stack([turn, centre - turn @ centre])


def image_matrix(unrotation_deg: float, *, height: int, width: int) -> FloatArray:
    """The 2 × 3 matrix that takes a canvas point (x, y, 1) back to the image."""
    return canvas_matrix(-unrotation_deg, height=height, width=width)


def canvas_columns(image: AnyArray, unrotation_deg: float) -> AnyArray:
    """The un-rotated image as canvas columns (x, y): bilinear, 0 where the canvas shows nothing of the image."""
    height, width = image.shape
    matrix = canvas_matrix(unrotation_deg, height=height, width=width)[::-1]
    turned: AnyArray = cv2.warpAffine(
        image, matrix, (height, width), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0
    )
    return turned
