"""How much of the image's width the object takes."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from rahas.typing import AnyArray, BoolArray

_SPAN_PERCENTILE = 95.0


def measurable_from_modulation(*, modulation: AnyArray, noise_sigma: AnyArray, least_ratio: float = 5.0) -> BoolArray:
    """Where stripes can be measured: modulation at least ``least_ratio`` σ of one frame's noise, stray pixels cleaned.

    All arrays (y, x) in grey levels.
    """
    return without_stray_pixels(np.asarray(modulation >= least_ratio * noise_sigma))


def without_stray_pixels(region: BoolArray) -> BoolArray:
    """The region (y, x) without what a square of 3 × 3 pixels does not fit into; what remains keeps its outline."""
    square = np.ones((3, 3), np.uint8)
    seeds = cv2.erode(region.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=1)
    return np.asarray(cv2.dilate(seeds, square).astype(bool) & region)


def span_from_region(region: BoolArray) -> float:
    """Horizontal extent of a region as a share of the image's width: 95th percentile over the rows that have any.

    Holes and shadows inside do not matter. An empty region spans 0.

    >>> region = np.zeros((4, 10), bool)
    >>> region[1:3, 2] = region[1:3, 6] = True
    >>> span_from_region(region)
    0.5
    """
    rows = region[region.any(axis=1)]
    if not len(rows):
        return 0.0
    first = rows.argmax(axis=1)
    last = rows.shape[1] - 1 - rows[:, ::-1].argmax(axis=1)
    return float(np.percentile(last - first + 1, _SPAN_PERCENTILE) / rows.shape[1])


def surface_at_centre(depth: AnyArray, *, largest_step: float, bridged: int = 0) -> BoolArray:
    """The connected surface that the image's centre, or the measured point nearest to it, lies on.

    Neighbours (4-connected) belong together when both are measured and their depths differ by at most
    ``largest_step``.

    Parameters
    ----------
    depth
        (y, x) in mm, NaN where nothing was measured.
    largest_step
        mm.
    bridged
        Pixels: gaps in a column up to this long do not part a surface, if the step across is that of a slope no
        steeper than ``largest_step`` a pixel (the thesis leaves out four rows at every stripe).

    Returns
    -------
    (y, x) bool, all false when nothing was measured.
    """
    measured = np.isfinite(depth)
    if not measured.any():
        return measured
    depth = _bridged(depth, bridged) if bridged else depth
    with np.errstate(invalid="ignore"):
        right = np.abs(np.diff(depth, axis=1)) <= largest_step
        down = np.abs(np.diff(depth, axis=0)) <= largest_step
    # On a grid of twice the density, links are cells of their own: then 4-connected labelling is the answer.
    height, width = measured.shape
    cells = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    cells[::2, ::2] = np.isfinite(depth)
    cells[::2, 1::2] = right
    cells[1::2, ::2] = down
    labels = _components(cells)[::2, ::2]
    rows, columns = np.nonzero(measured)
    away = (rows - (height - 1) / 2) ** 2 + (columns - (width - 1) / 2) ** 2
    nearest = int(np.argmin(away))
    return np.asarray((labels == labels[rows[nearest], columns[nearest]]) & measured)


def _bridged(depth: AnyArray, longest: int) -> AnyArray:
    """Depth (y, x) with short gaps in the columns filled by straight lines."""
    rows = np.arange(len(depth))[:, None]
    known = np.isfinite(depth)
    above = np.maximum.accumulate(np.where(known, rows, -1), axis=0)
    below = np.minimum.accumulate(np.where(known, rows, len(depth))[::-1], axis=0)[::-1]
    short = ~known & (above >= 0) & (below < len(depth)) & (below - above - 1 <= longest)
    y, x = np.nonzero(short)
    top, bottom = above[y, x], below[y, x]
    filled = depth.copy()
    share = (y - top) / (bottom - top)
    filled[y, x] = depth[top, x] * (1 - share) + depth[bottom, x] * share
    return filled


def _components(cells: npt.NDArray[np.uint8]) -> AnyArray:
    _, labels = cv2.connectedComponents(cells, connectivity=4)
    return np.asarray(labels)
