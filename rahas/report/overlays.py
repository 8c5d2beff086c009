"""Drawings over a frame: snakes on the un-rotated canvas, calibration marks with their residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from rahas.kernels.unrotation import canvas_matrix
from rahas.report.colours import identity_colour
from rahas.report.figures import write

_SUBPIXEL_BITS = 4
_MARK_COLOUR, _ARROW_COLOUR = (120, 190, 40), (40, 60, 235)
_LONGEST_ARROW_PX = 34.0
_DIMMED = 0.72


def unrotated(picture: np.ndarray, unrotation_deg: float) -> np.ndarray:
    """The picture on the un-rotated canvas: turned by R(unrotation) about its centre ((W−1)/2, (H−1)/2), same size."""
    if abs(unrotation_deg) < 1e-6:
        return picture.copy()
    height, width = picture.shape[:2]
    matrix = canvas_matrix(unrotation_deg, height=height, width=width)
    return cv2.warpAffine(picture, matrix, (width, height), flags=cv2.INTER_LINEAR, borderValue=(226, 231, 233))


def with_snakes(picture: np.ndarray, identity: Any, rows: Any, *, unrotation_deg: float) -> np.ndarray:
    """``picture`` un-rotated, with every snake as a line in the colour of its identity.

    ``identity`` and ``rows`` are (snake, x): one frame of Si and Sy, in the picture's own pixels.
    """
    identity, rows = np.asarray(identity), np.asarray(rows, dtype=np.float64)
    drawn = unrotated(cv2.convertScaleAbs(picture, alpha=_DIMMED), unrotation_deg)
    for snake in range(identity.shape[0]):
        on = (identity[snake] > 0) & np.isfinite(rows[snake])
        columns = np.flatnonzero(on)
        if columns.size == 0:
            continue
        for piece in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1):
            points = np.column_stack([piece, rows[snake, piece]]) * (1 << _SUBPIXEL_BITS)
            colour = identity_colour(int(identity[snake, piece[0]]))
            cv2.polylines(drawn, [points.round().astype(np.int32)], False, colour, 2, cv2.LINE_AA, _SUBPIXEL_BITS)
    _number_snakes(drawn, identity, rows)
    return drawn


def _number_snakes(picture: np.ndarray, identity: np.ndarray, rows: np.ndarray) -> None:
    """Write each snake's identity where it starts, as far as there is room."""
    last_row = -np.inf
    for snake in range(identity.shape[0]):
        columns = np.flatnonzero((identity[snake] > 0) & np.isfinite(rows[snake]))
        if columns.size == 0:
            continue
        row, column = rows[snake, columns[0]], int(columns[0])
        if abs(row - last_row) < 18 or not 8 <= row < picture.shape[0] - 4:
            continue
        last_row = row
        at = (max(4, min(column, picture.shape[1] - 30)), int(row) + 5)
        _write_on_frame(picture, str(int(identity[snake, columns[0]])), at)


def arrow_magnification(marks: Sequence[Mapping[str, Any]]) -> int:
    """How many times the residuals are enlarged, so that the longest arrow is seen; 0 without residuals."""
    lengths = [np.hypot(*residual) for mark in marks if (residual := residual_of(mark)) is not None]
    longest = max(lengths, default=0.0)
    if not longest > 0:
        return 0
    wanted = _LONGEST_ARROW_PX / longest
    power = 10.0 ** np.floor(np.log10(wanted))
    return max(1, int(next(step for step in (5, 2, 1) if wanted >= step * power) * power))


def residual_of(mark: Mapping[str, Any]) -> tuple[float, float] | None:
    """Measured minus modelled image position of a calibration mark, px (x, y); None where it was not kept."""
    dx, dy = mark.get("residual_x_px"), mark.get("residual_y_px")
    return None if dx is None or dy is None else (float(dx), float(dy))


def with_marks(picture: np.ndarray, marks: Sequence[Mapping[str, Any]], *, scale: float = 1.0) -> np.ndarray:
    """``picture`` with a ring and number at each mark and its residual as an enlarged arrow.

    ``scale`` is picture pixels per image pixel.
    """
    drawn = picture.copy()
    magnification = arrow_magnification(marks)
    for mark in marks:
        at = np.array([float(mark["x_px"]), float(mark["y_px"])]) * scale
        cv2.circle(drawn, _fixed(at), int(9 * (1 << _SUBPIXEL_BITS)), _MARK_COLOUR, 2, cv2.LINE_AA, _SUBPIXEL_BITS)
        _write_on_frame(drawn, str(mark["mark"]), (int(at[0]) + 13, int(at[1]) - 9))
        residual = residual_of(mark)
        if residual is not None and magnification:
            tip = at + np.array(residual) * magnification * scale
            cv2.arrowedLine(drawn, _fixed(at), _fixed(tip), _ARROW_COLOUR, 2, cv2.LINE_AA, _SUBPIXEL_BITS, 0.25)
    return drawn


def _write_on_frame(picture: np.ndarray, text: str, at: tuple[int, int]) -> None:
    """White letters with a dark rim, to be read on any ground."""
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1), (1, 1)):
        write(picture, text, (at[0] + dx, at[1] + dy), size=16, weight=600, colour=(20, 20, 20))
    write(picture, text, at, size=16, weight=600, colour=(255, 255, 255))


def _fixed(point: np.ndarray) -> tuple[int, int]:
    return round(float(point[0]) * (1 << _SUBPIXEL_BITS)), round(float(point[1]) * (1 << _SUBPIXEL_BITS))
