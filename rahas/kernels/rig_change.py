"""What moved between calibration and scan, and what it does to depth, from how the first hold's pattern lies beside it.

In the projector's own tangents u (across the field) and v (down it), with K radians of phase per tangent, small changes
move the first stop's phase Φ0 = K·u and the scan's phase Φ = K·v by

| change | Φ0 | Φ |
|---|---|---|
| slide moved in its holder by s | s | s |
| projector turned about its upright axis, ψ | K·ψ·(1 + u²) | K·ψ·u·v |
| projector turned up or down, τ | K·τ·u·v | K·τ·(1 + v²) |
| projector or slide turned about the optical axis, ρ | −K·ρ·v | K·ρ·u |
| zoom of the projector changed, z | K·z·u | K·z·v |
| zoom of the camera changed, z | −z·p·∇Φ0 | −z·p·∇Φ |

with p the pixel from the image's middle. They leave different traces in Φ0, low-order polynomials over the image, so
they can be told apart: τ, which hardly moves Φ0 but moves depth most, by its keystone u·v. As few of them as explain
the image are believed.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from rahas.typing import FloatArray

CHANGES = ("slide_shift", "projector_yaw", "projector_pitch", "projector_roll", "projector_zoom", "camera_zoom")
_PRICE = (
    16.0,
    25.0,
    16.0,
    16.0,
    16.0,
    16.0,
)  # of χ² for each believed: four standard deviations; where slide shift and
# projector yaw explain the image alike, the one that spoils depth is believed
_MODEL_STD_RAD = 0.002  # of each term: what a sound calibration leaves in the difference


class RigChange(NamedTuple):
    """The change that explains the first hold."""

    size: FloatArray
    """(6,) of CHANGES, 0 where not believed: rad of phase, then rad, rad, rad, share of the focal length."""
    phase_of_each: FloatArray
    """(n, 6) rad, what each adds to the scan's phase at the pixels."""
    phase_std: FloatArray
    """(n,) rad, of their sum, these being the changes."""


def explain_change(
    terms: FloatArray,
    covariance: FloatArray,
    columns: FloatArray,
    u: FloatArray,
    v: FloatArray,
    camera_zoom: tuple[FloatArray, FloatArray],
    followed: FloatArray,
    *,
    per_tangent_first: float,
    per_tangent: float,
) -> RigChange:
    """Simplest change for a difference columns·``terms``, (n, p) and (p,) rad, known to ``covariance`` (p, p).

    ``u``, ``v`` (n,) tangents of the pixels in the projector; K of the first stop's phase and of the scan's, signed.
    ``camera_zoom`` are the last line's two columns (n,), −p·∇Φ0 and −p·∇Φ. Where the stripes are not quite along the
    epipolar lines, the difference was taken at points that had moved with the scan's phase: ``followed`` (n,) is by how
    much the expected phase follows it.
    """
    one, first, scan = np.ones_like(u), per_tangent_first, per_tangent
    of_first = np.column_stack([one, first * (1.0 + u * u), first * u * v, -first * v, first * u, camera_zoom[0]])
    of_scan = np.column_stack([one, scan * u * v, scan * (1.0 + v * v), scan * u, scan * v, camera_zoom[1]])
    traces = np.linalg.lstsq(columns, of_first - followed[:, None] * of_scan, rcond=None)[0]
    certain = np.linalg.inv(covariance + _MODEL_STD_RAD**2 * np.eye(len(terms)))
    best, size, spread = float(terms @ certain @ terms), np.zeros(len(CHANGES)), np.zeros((len(CHANGES),) * 2)
    for count in range(1, len(CHANGES) + 1):
        for choice in combinations(range(len(CHANGES)), count):
            if {0, 1} <= set(choice):  # alike but for a curvature: together they explain anything, with large sizes
                continue
            own = traces[:, choice]
            variance = np.linalg.inv(own.T @ certain @ own)
            values = variance @ (own.T @ (certain @ terms))
            left = terms - own @ values
            price = float(left @ certain @ left) + sum(_PRICE[one] for one in choice)
            if price < best:
                best, size, spread = price, np.zeros(len(CHANGES)), np.zeros((len(CHANGES),) * 2)
                size[list(choice)] = values
                spread[np.ix_(choice, choice)] = variance
    std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", of_scan, spread, of_scan), 0.0))
    return RigChange(size, of_scan * size, std)
