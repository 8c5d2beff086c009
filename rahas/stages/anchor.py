"""One zero for the labels of a scan and its calibration, or a reason why there is none."""

from __future__ import annotations

from rahas.errors import CaptureProblem
from rahas.kernels.label_anchor import Anchor, order_of_first_snake
from rahas.params import PhaseParams
from rahas.typing import AnyArray


def anchor_labels(own: AnyArray | None, calibration: AnyArray | None, params: PhaseParams) -> Anchor:
    """Fringe order of snake 1 from stripe positions (snake,) in the first hold; ``None`` for a calibration, the zero.

    Raises
    ------
    CaptureProblem
        No stripes to compare, or the slide did not sit as in the calibration.
    """
    try:
        anchor = order_of_first_snake(own, calibration)
    except ValueError as error:
        raise CaptureProblem(
            "tracking",
            "first_positions",
            f"The stripes of the first hold could not be compared with the calibration's ({error}): hold still for a "
            "second before turning the lever.",
        ) from None
    residual = anchor.residual_stripes
    if residual is not None and residual > params.max_label_residual_stripes:
        raise CaptureProblem(
            "calibration",
            "label_residual_stripes",
            f"In the first hold the stripes lie {residual:.2f} of a stripe beside where they lay in the calibration: "
            "the slide, focus or zoom was changed in between. Scan the target again with each set-up.",
            value=residual,
            limit=params.max_label_residual_stripes,
            unit="stripe",
        )
    return anchor
