"""Small displacements of the object in the image, frame by frame, from the slopes of what the pixels hold.

A bump moves camera and projector together against the object. To first order a frame then shows I − d·∇I, and with
I = a + c·cos δ + s·sin δ its slope follows from those of the images a, c = b cos φ and s = −b sin φ. Only the relief's
part of the phase goes along with the object; the carrier, what an even surface would show, stays with the rig.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import cv2
import numpy as np

from rahas.kernels.phase_shifting import wrap
from rahas.typing import AnyArray, FloatArray

LEAST_PX = 0.02  # a frame displaced by less is left as it is


class Displacements(NamedTuple):
    """Displacement of the object in each frame, from what a fit without it leaves."""

    shift: FloatArray  # (frame, 2), px along x and y
    std: FloatArray  # (frame, 2), px


class Slopes(NamedTuple):
    """How the object's images change along x and y."""

    images: FloatArray  # (2, 3, pixel), grey levels per px, of a, b cos φ and −b sin φ with the carrier at rest
    carrier: FloatArray  # (2,), radians per px, of the phase of an even surface


def slopes_at(background: AnyArray, modulation: AnyArray, phase: AnyArray, at: tuple[AnyArray, AnyArray]) -> Slopes:
    """Central differences at pixels ``at`` (rows, columns) of a, b and φ (y, x)."""
    rows, columns = at
    height, width = background.shape
    right, left = np.minimum(columns + 1, width - 1), np.maximum(columns - 1, 0)
    below, above = np.minimum(rows + 1, height - 1), np.maximum(rows - 1, 0)

    def both(field: AnyArray) -> FloatArray:
        return np.stack([field[rows, right] - field[rows, left], field[below, columns] - field[above, columns]])

    distance = np.maximum(np.stack([right - left, below - above]), 1)
    by_phase = wrap(both(phase)) / distance
    carrier = np.median(by_phase, axis=1)
    along, turned = both(modulation) / distance, modulation[at] * (by_phase - carrier[:, None])
    cosine, sine = np.cos(phase[at]), np.sin(phase[at])
    images = [both(background) / distance, along * cosine - turned * sine, -along * sine - turned * cosine]
    return Slopes(np.stack(images, axis=1).astype(np.float32), carrier)


def frame_slopes(delta: FloatArray, slopes: FloatArray) -> FloatArray:
    """Derivatives (2, frame, pixel) of the frames by the object's displacement, at steps δ (frame, pixel)."""
    cosine, sine = np.cos(delta), np.sin(delta)
    return np.stack([-(s[0] + s[1] * cosine + s[2] * sine) for s in slopes]).astype(np.float32)


def displacements_in(residual: FloatArray, others: FloatArray, derivatives: FloatArray) -> Displacements:
    """What displacement explains of each frame's residual.

    Parameters
    ----------
    residual
        (frame, pixel), grey levels.
    others
        (frame, pixel, term), derivatives by the frame's other unknowns, which are left free.
    derivatives
        (2, frame, pixel), as from :func:`frame_slopes`.
    """
    columns = np.concatenate([derivatives.transpose(1, 2, 0), others], axis=-1).astype(float)
    normal = columns.transpose(0, 2, 1) @ columns
    size = np.einsum("nii->ni", normal)
    normal += 1e-6 * np.eye(columns.shape[2]) * np.maximum(size.max(axis=1), 1e-9)[:, None, None]
    inverse = np.linalg.inv(normal)
    right = np.einsum("npi,np->ni", columns, residual)
    noise = 1.4826 * np.median(np.abs(residual))
    shift = np.einsum("nij,nj->ni", inverse[:, :2], right)
    return Displacements(shift, noise * np.sqrt(np.einsum("nii->ni", inverse[:, :2, :2])))


def moved_back(blocks: Iterable[AnyArray], shift: FloatArray) -> Iterator[AnyArray]:
    """Blocks of frames (n, y, x) with the displacement (frame, 2) of each undone."""
    start = 0
    for block in blocks:
        here = shift[start : start + len(block)]
        start += len(block)
        if np.hypot(*here.T).max(initial=0.0) < LEAST_PX:
            yield block
            continue
        moved = np.empty(block.shape, np.float32)  # not rounded to grey levels once more
        for target, frame, (x, y) in zip(moved, block, here, strict=True):
            matrix = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
            flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
            shown = frame.astype(np.float32)
            target[:] = cv2.warpAffine(shown, matrix, shown.shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE)
        yield moved
