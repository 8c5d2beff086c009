"""Which mark of the target each dark ellipse is (thesis 2.3.3): no help needed but that the target stands upright.

Two ellipses taken for two marks give a similarity, which predicts all others; the best guesses are grown, first as an
affine then as a perspective camera, until they explain as many ellipses as they can.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import Camera, camera_matrix_from_marks, project
from rahas.typing import FloatArray, IntArray

_MAX_ELLIPSES = 60
_GUESSES_GROWN = 40


class MarkIdentity(NamedTuple):
    """Ellipses and the marks they are, k pairs."""

    mark: IntArray
    """(k,) row of the target table."""
    ellipse: IntArray
    """(k,) index of the ellipse."""


def identify_marks(
    centre: FloatArray, radius: FloatArray, target: FloatArray, *, max_turn_deg: float = 40.0
) -> MarkIdentity:
    """Match ellipses, ``centre`` (n, 2) and mean ``radius`` (n,) in px, to the marks ``target`` (m, 3) in mm.

    Ellipses that are no marks, and marks that are not seen, are left out; rows of the table stand in any order.
    No match gives empty arrays.
    """
    centre, radius, index = _likely(centre, radius)
    best = MarkIdentity(np.empty(0, np.int64), np.empty(0, np.int64))
    if len(centre) < 6 or len(target) < 6:
        return best
    best_rms = np.inf
    for prediction in _guesses(centre, radius, target, np.deg2rad(max_turn_deg)):
        grown, rms = _grow(prediction, centre, radius, target)
        if (len(grown.mark), -rms) > (len(best.mark), -best_rms):
            best, best_rms = grown, rms
        if len(best.mark) == len(target) and best_rms < 0.05 * float(np.median(radius)):
            break
    return MarkIdentity(best.mark, index[best.ellipse])


def mark_spacing(points: FloatArray) -> FloatArray:
    """Distance (n,) of each point to its nearest neighbour."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    nearest: FloatArray = distance.min(axis=1)
    return nearest


def _likely(centre: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """The ellipses whose size has the most company (within a factor of 1.8 either way), at most sixty."""
    index = np.arange(len(centre))
    if len(centre) == 0:
        return centre, radius, index
    ratio = np.abs(np.log(radius[:, None] / radius[None])) < np.log(1.8)
    company = ratio.sum(axis=1)
    keep = ratio[int(np.argmax(company))]
    index = index[keep]
    if len(index) > _MAX_ELLIPSES:
        typical = np.abs(np.log(radius[index] / np.median(radius[index])))
        index = index[np.argsort(typical)[:_MAX_ELLIPSES]]
    return centre[index], radius[index], index


def _guesses(centre: FloatArray, radius: FloatArray, target: FloatArray, max_turn: float) -> list[FloatArray]:
    """Predicted image positions (m, 2) of all marks under the most promising similarities, best first."""
    plan = target[:, 0] - 1j * target[:, 1]  # image y points down
    image = centre[:, 0] + 1j * centre[:, 1]
    i, j = np.nonzero(~np.eye(len(image), dtype=bool))
    alike = np.abs(np.log(radius[i] / radius[j])) < np.log(1.6)
    i, j = i[alike], j[alike]
    predictions, scores = [], []
    for a, b in _telling_pairs(plan):
        zoom = (image[j] - image[i]) / (plan[b] - plan[a])
        upright = np.abs(np.angle(zoom)) < max_turn
        if not upright.any():
            continue
        predicted = image[i][upright, None] + zoom[upright, None] * (plan - plan[a])[None]
        tolerance = 0.4 * np.abs(zoom[upright]) * float(np.median(mark_spacing(target[:, :2])))
        distance = np.abs(predicted[:, :, None] - image[None, None]).min(axis=2)
        close = np.clip(1.0 - (distance / tolerance[:, None]) ** 2, 0.0, None)
        scores.append(close.sum(axis=1))
        predictions.append(predicted)
    if not scores:
        return []
    score, predicted = np.concatenate(scores), np.concatenate(predictions)
    order = np.argsort(-score)[:_GUESSES_GROWN]
    return [np.column_stack([predicted[k].real, predicted[k].imag]) for k in order]


def _telling_pairs(plan: FloatArray) -> list[tuple[int, int]]:
    """Pairs of marks far apart, no mark in more than two of them: hidden marks spoil few."""
    distance = np.abs(plan[:, None] - plan[None])
    pairs: list[tuple[int, int]] = []
    used = np.zeros(len(plan), dtype=int)
    for flat in np.argsort(-distance, axis=None):
        a, b = divmod(int(flat), len(plan))
        if a < b and used[a] < 2 and used[b] < 2:
            pairs.append((a, b))
            used[[a, b]] += 1
    return pairs


def _grow(
    predicted: FloatArray, centre: FloatArray, radius: FloatArray, target: FloatArray
) -> tuple[MarkIdentity, float]:
    """Match, fit a camera, predict, match again; returns the pairs and their rms residual in px."""
    match = _match(predicted, centre, share=0.45)
    for model in ("affine", "affine", "affine", "perspective", "perspective", "perspective"):
        if len(match.mark) < 6:
            return MarkIdentity(match.mark[:0], match.ellipse[:0]), np.inf
        if model == "affine":
            predicted = _affine_prediction(target, match, centre)
        else:
            try:
                matrix = camera_matrix_from_marks(target[match.mark], centre[match.ellipse])
            except ValueError:
                return MarkIdentity(match.mark[:0], match.ellipse[:0]), np.inf
            depth = target @ matrix[2, :3] + 1.0
            if not np.all(depth > 0.05):  # a camera that has marks behind it
                return MarkIdentity(match.mark[:0], match.ellipse[:0]), np.inf
            predicted = project(Camera(matrix, 0.0, np.zeros(2)), target)
        match = _match(predicted, centre, share=0.35 if model == "affine" else 0.15)
    residual = centre[match.ellipse] - predicted[match.mark]
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))) if len(residual) else np.inf
    if len(match.mark) < 8 or rms > 0.3 * float(np.median(radius)) + 0.5:
        return MarkIdentity(match.mark[:0], match.ellipse[:0]), np.inf
    return match, rms


def _match(predicted: FloatArray, centre: FloatArray, *, share: float) -> MarkIdentity:
    """Mutual nearest neighbours closer than ``share`` of the predicted mark's distance to its next mark."""
    distance = np.linalg.norm(predicted[:, None] - centre[None], axis=-1)
    nearest = distance.argmin(axis=1)
    mutual = distance.argmin(axis=0)[nearest] == np.arange(len(predicted))
    close = distance[np.arange(len(predicted)), nearest] < share * mark_spacing(predicted)
    mark = np.nonzero(mutual & close)[0]
    return MarkIdentity(mark, nearest[mark])


def _affine_prediction(target: FloatArray, match: MarkIdentity, centre: FloatArray) -> FloatArray:
    """Image positions of all marks by the affine camera of the pairs, depth damped as few pairs may not show it."""
    origin = target.mean(axis=0)
    reach = float(np.abs(target - origin).max())
    design = np.column_stack([(target - origin) / reach, np.ones(len(target))])
    rows = design[match.mark]
    damping = np.diag([0.0, 0.0, 0.02, 0.0])
    solution = np.linalg.lstsq(rows.T @ rows + damping, rows.T @ centre[match.ellipse], rcond=None)[0]
    predicted: FloatArray = design @ solution
    return predicted
