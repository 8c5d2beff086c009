"""One Gauss–Newton step over the frames' unknowns, with each pixel's own unknowns projected out (Schur complement)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgesv

from rahas.kernels.pixel_fit import PixelFit
from rahas.typing import FloatArray

PART = 512  # pixels at a time: their derivatives are many times larger than their frames


class Prior(NamedTuple):
    """Gaussian priors of the unknowns; a course over the frames that needs no excuse is free of them."""

    weight: FloatArray  # (term,) of a frame's unknowns: noise variance over prior variance, 0 where there is none
    distance: FloatArray  # (frame, term), from the prior's mean
    courses: list[FloatArray]  # for each term (frame, k): courses over the frames that cost nothing
    shared_weight: FloatArray  # (shared,)
    shared_distance: FloatArray  # (shared,)


def without_courses(courses: FloatArray) -> FloatArray:
    """The projection (frame, frame) that takes such courses (frame, k) out of one."""
    orthonormal = np.linalg.qr(courses)[0]
    return np.eye(len(courses)) - orthonormal @ orthonormal.T


def reduced_step(
    fit: PixelFit, columns: Callable[[PixelFit, slice], tuple[FloatArray, FloatArray]], prior: Prior
) -> tuple[FloatArray, FloatArray]:
    """Changes of the frames' unknowns (frame, term) and of the shared ones (shared,).

    Parameters
    ----------
    columns
        Of a part of the pixels: (frame, pixel, term), derivatives of the frames by their own unknowns, and
        (frame, pixel, shared), derivatives by the unknowns that all frames share.
    """
    frames, pixels = fit.residual.shape
    parts = [slice(first, first + PART) for first in range(0, pixels, PART)]
    terms, shared = prior.weight.size, prior.shared_weight.size
    count = frames * terms
    normal, right = np.zeros((count + shared, count + shared)), np.zeros(count + shared)
    for part in parts:
        own = fit.only(part)
        _add_equations(normal, right, own, *columns(own, part))
    for term in np.flatnonzero(prior.weight):
        precision = prior.weight[term] * without_courses(prior.courses[term])
        normal[term:count:terms, term:count:terms] += precision
        right[term:count:terms] -= precision @ prior.distance[:, term]
    right[count:] -= prior.shared_weight * prior.shared_distance
    diagonal = np.einsum("ii->i", normal)
    diagonal[count:] += prior.shared_weight
    diagonal += 1e-7 * np.median(diagonal[diagonal > 0])
    _, _, solution, failed = dgesv(normal.T, right, overwrite_a=True)  # symmetric; in place: it may be 100 MB
    if failed:
        raise np.linalg.LinAlgError(f"no step of {count + shared} unknowns: the normal matrix is singular")
    return solution[:count].reshape(frames, terms), solution[count:]


def _add_equations(
    normal: FloatArray, right: FloatArray, fit: PixelFit, by_frame: FloatArray, by_shared: FloatArray
) -> None:
    """Add normal matrix and right side of a part of the pixels, their own unknowns projected out."""
    frames, pixels, terms = by_frame.shape
    count, shared = frames * terms, by_shared.shape[2]
    columns = np.stack([np.ones_like(fit.value), fit.value, fit.slope], axis=-1).transpose(1, 0, 2)
    orthonormal = (columns @ fit.factor.astype(columns.dtype)).transpose(0, 2, 1)  # (pixel, 3, frame)
    reduced = np.empty((pixels, 3, count + shared), dtype=np.float32)
    reduced[..., :count] = (orthonormal[..., None] * by_frame.transpose(1, 0, 2)[:, None]).reshape(pixels, 3, count)
    reduced[..., count:] = np.matmul(orthonormal, by_shared.transpose(1, 0, 2))
    rows = reduced.reshape(-1, count + shared)
    for first in range(0, count + shared, PART):  # by stripes: no second matrix of that size
        normal[first : first + PART] -= rows[:, first : first + PART].T @ rows
    transposed = by_frame.transpose(0, 2, 1)
    blocks, cross = np.matmul(transposed, by_frame), np.matmul(transposed, by_shared)
    for n in range(frames):
        here = slice(n * terms, (n + 1) * terms)
        normal[here, here] += blocks[n]
        normal[here, count:] += cross[n]
        normal[count:, here] += cross[n].T
    flat = by_shared.reshape(-1, shared)
    normal[count:, count:] += flat.T @ flat
    # the residual is orthogonal to the pixels' own columns already
    right[:count] += np.matmul(transposed, fit.residual[..., None]).reshape(-1)
    right[count:] += flat.T @ fit.residual.reshape(-1)
