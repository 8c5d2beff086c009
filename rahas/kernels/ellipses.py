"""Ellipses through outline points."""

from __future__ import annotations

import numpy as np

from rahas.typing import FloatArray

Ellipse = tuple[float, float, float, float, float]
"""x, y, longer and shorter semi-axis, direction of the longer one (rad, from x towards y)."""


def radius_of_ellipse(ellipse: Ellipse, directions: FloatArray) -> FloatArray:
    """Distance of the outline from the centre along unit ``directions`` (n, 2)."""
    _, _, longer, shorter, direction = ellipse
    along = directions @ np.array([np.cos(direction), np.sin(direction)])
    across = directions @ np.array([-np.sin(direction), np.cos(direction)])
    radius: FloatArray = 1.0 / np.hypot(along / longer, across / shorter)
    return radius


def fit_ellipse(points: FloatArray) -> Ellipse | None:
    """Direct least-squares ellipse (Halíř & Flusser 1998): x, y, longer and shorter semi-axis, direction."""
    mean = points.mean(axis=0)
    size = float(np.abs(points - mean).max())
    x, y = ((points - mean) / size).T
    quadratic = np.column_stack([x * x, x * y, y * y])
    linear = np.column_stack([x, y, np.ones_like(x)])
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    back = -np.linalg.solve(s3, s2.T)
    reduced = s1 + s2 @ back
    values, vectors = np.linalg.eig(np.array([reduced[2] / 2.0, -reduced[1], reduced[0] / 2.0]))
    vectors = np.real(vectors)
    condition = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    if not np.any(condition > 0) or not np.all(np.isfinite(values)):
        return None
    a, b, c = vectors[:, int(np.argmax(condition))]
    d, e, f = back @ np.array([a, b, c])
    shape = np.array([[a, b / 2.0], [b / 2.0, c]])
    middle = np.linalg.solve(2.0 * shape, -np.array([d, e]))
    level = middle @ shape @ middle - f
    spectrum, axes = np.linalg.eigh(shape / level)
    if spectrum[0] <= 0:
        return None
    longer, shorter = 1.0 / np.sqrt(spectrum)
    direction = float(np.arctan2(axes[1, 0], axes[0, 0]))
    cx, cy = middle * size + mean
    return float(cx), float(cy), float(longer * size), float(shorter * size), direction


def distance_to_ellipse(points: FloatArray, ellipse: Ellipse) -> FloatArray:
    """Signed distance (first order) of points from the outline, px."""
    x, y, longer, shorter, direction = ellipse
    turn = np.array([[np.cos(direction), np.sin(direction)], [-np.sin(direction), np.cos(direction)]])
    scaled = (points - [x, y]) @ turn.T / [longer, shorter]
    radius = np.hypot(scaled[:, 0], scaled[:, 1])
    gradient = np.hypot(scaled[:, 0] / longer, scaled[:, 1] / shorter) / np.maximum(radius, 1e-9)
    distance: FloatArray = (radius - 1.0) / np.maximum(gradient, 1e-9)
    return distance
