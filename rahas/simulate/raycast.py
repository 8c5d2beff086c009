"""Rays against a height field: where a camera ray ends, and whether the projector's light gets there."""

from __future__ import annotations

import math

import cv2
import numba
import numpy as np

from rahas.typing import Float32Array, FloatArray


@numba.njit(cache=True, inline="always")
def sample(field: Float32Array, column: float, row: float) -> float:
    """Bilinear value; beyond the border the border's."""
    rows, columns = field.shape
    column = min(max(column, 0.0), columns - 1.001)
    row = min(max(row, 0.0), rows - 1.001)
    i, j = int(row), int(column)
    fy, fx = row - i, column - j
    top = field[i, j] * (1 - fx) + field[i, j + 1] * fx
    bottom = field[i + 1, j] * (1 - fx) + field[i + 1, j + 1] * fx
    return top * (1 - fy) + bottom * fy


@numba.njit(cache=True)
def ray_lengths(
    height: Float32Array, spacing: float, origin: FloatArray, rays: FloatArray, steepest: float
) -> FloatArray:
    """Way along −z (y, x) in mm at which each ray meets the surface.

    ``rays`` (y, x, 2) are slopes of x and y; ``steepest`` bounds the surface's slope: marching by what that
    bound allows never jumps through the surface; bisection ends it.
    """
    rows, columns = rays.shape[:2]
    middle_row, middle_column = (height.shape[0] - 1) / 2, (height.shape[1] - 1) / 2
    highest, lowest = float(height.max()), float(height.min())
    lengths = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            sx, sy = rays[i, j, 0], rays[i, j, 1]
            rate = 1.0 + steepest * math.sqrt(sx * sx + sy * sy)
            before = origin[2] - highest - 1e-3
            after = before
            end = origin[2] - lowest + 1e-3
            while after < end:
                column = (origin[0] + after * sx) / spacing + middle_column
                row = (origin[1] + after * sy) / spacing + middle_row
                gap = origin[2] - after - sample(height, column, row)
                if gap <= 0:
                    break
                before = after
                after += max(gap / rate, 0.05)
            for _ in range(14):
                half = (before + after) / 2
                column = (origin[0] + half * sx) / spacing + middle_column
                row = (origin[1] + half * sy) / spacing + middle_row
                if origin[2] - half - sample(height, column, row) > 0:
                    before = half
                else:
                    after = half
            lengths[i, j] = (before + after) / 2
    return lengths


@numba.njit(cache=True)
def lamp_light(
    height: Float32Array, spacing: float, points: FloatArray, lamp: FloatArray, lamp_axis: FloatArray, far_mm: float
) -> FloatArray:
    """Lamp light arriving at each point (y, x): incidence, distance, the lamp's own fall-off; 0 in shadow.

    ``points`` (y, x, 3) lie on the surface; ``far_mm`` is the distance at which light counts as 1.
    """
    rows, columns = points.shape[:2]
    middle_row, middle_column = (height.shape[0] - 1) / 2, (height.shape[1] - 1) / 2
    highest = float(height.max())
    light = np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            x, y, z = points[i, j, 0], points[i, j, 1], points[i, j, 2]
            column, row = x / spacing + middle_column, y / spacing + middle_row
            slope_x = (sample(height, column + 1, row) - sample(height, column - 1, row)) / (2 * spacing)
            slope_y = (sample(height, column, row + 1) - sample(height, column, row - 1)) / (2 * spacing)
            tx, ty, tz = lamp[0] - x, lamp[1] - y, lamp[2] - z
            distance = math.sqrt(tx * tx + ty * ty + tz * tz)
            incidence = (tz - tx * slope_x - ty * slope_y) / (
                distance * math.sqrt(1 + slope_x * slope_x + slope_y * slope_y)
            )
            if incidence <= 0:
                continue
            rise_x, rise_y = tx / tz, ty / tz
            up, clear = 0.3, True
            while z + up < highest:
                column = (x + up * rise_x) / spacing + middle_column
                row = (y + up * rise_y) / spacing + middle_row
                gap = z + up - sample(height, column, row)
                if gap < -0.1:
                    clear = False
                    break
                up += max(0.35 * gap, 0.5)
            if clear:
                aim = -(tx * lamp_axis[0] + ty * lamp_axis[1] + tz * lamp_axis[2]) / distance
                light[i, j] = incidence * aim * aim * (far_mm / distance) ** 2
    return light


@numba.njit(cache=True)
def sample_map(field: Float32Array, columns: FloatArray, rows: FloatArray) -> FloatArray:
    """Bilinear values of the field at positions (y, x)."""
    values = np.empty(columns.shape)
    for i in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            values[i, j] = sample(field, columns[i, j], rows[i, j])
    return values


def enlarge(values: Float32Array, height: int, width: int) -> FloatArray:
    """Bilinear enlargement (y, x, channel) of values that stand for whole blocks of pixels."""
    return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float64)
