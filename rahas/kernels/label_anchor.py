"""One zero for the stripe labels of a scan and its calibration.

In the first hold the stripes run along the epipolar lines: where they lie in the image does not depend on the surface.
With the slide back at its stop, a stripe lies where it lay in the calibration, and the labels follow from position.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray


class Anchor(NamedTuple):
    """Label offset between two captures of one set-up."""

    order: int  # fringe order of the maximum that snake 1 lies on
    residual_stripes: float | None  # median distance of the matched stripes, in stripes; None: the zero itself


def order_of_first_snake(own: AnyArray | None, calibration: AnyArray | None) -> Anchor:
    """Fringe order of snake 1, from stripe positions in the first hold.

    Parameters
    ----------
    own, calibration
        (snake,), position of each labelled stripe across the stripes, pixels, NaN where not seen. ``None`` for a
        calibration, whose snake 1 is the zero.

    Raises
    ------
    ValueError
        Nothing to compare.
    """
    if own is None or calibration is None:
        return Anchor(0, None)
    own_index, calibration_index = np.flatnonzero(np.isfinite(own)), np.flatnonzero(np.isfinite(calibration))
    if not len(own_index) or len(calibration_index) < 2:
        raise ValueError(f"no stripes to compare: {len(own_index) = }, {len(calibration_index) = }")
    # the calibration's labels as a smooth function of position carry over gaps and beyond its edge
    slope, offset = np.polyfit(calibration[calibration_index], calibration_index, 1)
    in_order = np.argsort(calibration[calibration_index])
    curve = calibration_index - (slope * calibration[calibration_index] + offset)
    own_curve = np.interp(own[own_index], calibration[calibration_index][in_order], curve[in_order])
    label = slope * own[own_index] + offset + own_curve
    shift = label - own_index
    order = int(np.rint(np.median(shift)))
    return Anchor(order, float(np.median(np.abs(shift - order))))
