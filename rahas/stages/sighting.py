"""The target in one image: its marks found, identified, and a camera fitted to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.camera import CameraFit, fit_camera
from rahas.kernels.mark_identity import MarkIdentity, identify_marks
from rahas.kernels.marks import find_marks
from rahas.kernels.roof import Roof, centre_shift, mark_radius
from rahas.typing import AnyArray, FloatArray, IntArray


class Target(NamedTuple):
    """The calibration target's table, n marks."""

    mark: IntArray
    """(n,) numbers of the marks."""
    world: FloatArray
    """(n, 3) mm: x right, y up, z towards the camera."""
    diameter_mm: FloatArray
    """(n,), NaN where not given."""


class Sighting(NamedTuple):
    """The target as one camera sees it, k marks."""

    row: IntArray
    """(k,) row of the table of each mark seen."""
    ellipse_centre: FloatArray
    """(k, 2) px as seen."""
    centre: FloatArray
    """(k, 2) px, corrected for perspective: the images of the marks' centres."""
    semi_axes: FloatArray
    """(k, 2) px."""
    radius_mm: float
    """Median radius of the marks: from the table, else from the image."""
    fit: CameraFit

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the marks from where the camera projects them."""
        return float(np.sqrt(np.mean(np.sum(self.fit.residual**2, axis=1))))


class TooFewMarks(Exception):
    """The target was not recognised in the image."""

    def __init__(self, found: int, dark_spots: int) -> None:
        super().__init__(f"{found} marks recognised among {dark_spots} dark round spots")
        self.found = found
        self.dark_spots = dark_spots


def sight_target(
    image: AnyArray,
    target: Target,
    roof: Roof,
    *,
    min_marks: int,
    radial_significance: float,
    quarter_turns: tuple[int, ...] = (0,),
) -> Sighting:
    """Find the target in a grey ``image`` (y, x) and fit a camera to it.

    The target stands upright once the image is turned by one of ``quarter_turns``, tried in their order.

    Raises
    ------
    TooFewMarks
        Fewer than ``min_marks`` marks are recognised, or they show one slope only.
    """
    found = find_marks(image)
    radius_px = np.sqrt(found.semi_axes[:, 0] * found.semi_axes[:, 1])
    identity = _identify(found.centre, radius_px, target.world, quarter_turns, min_marks)
    slope = roof.slope[identity.mark]
    if len(identity.mark) < max(min_marks, 6) or min(np.sum(slope == 0), np.sum(slope == 1)) < 3:
        raise TooFewMarks(len(identity.mark), len(found.centre))
    world, seen = target.world[identity.mark], found.centre[identity.ellipse]
    semi_axes = found.semi_axes[identity.ellipse]
    normals = roof.normal[slope]
    middle = np.array([(image.shape[1] - 1) / 2.0, (image.shape[0] - 1) / 2.0])
    fit = fit_camera(world, seen, centre=middle, significance=radial_significance)
    centre = seen
    radius = target.diameter_mm[identity.mark] / 2.0
    for _ in range(2):
        drawn = mark_radius(fit.camera, world, normals, semi_axes)
        radius = np.where(np.isfinite(target.diameter_mm[identity.mark]), radius, float(np.median(drawn)))
        centre = seen - centre_shift(fit.camera, world, normals, radius)
        fit = fit_camera(world, centre, centre=middle, significance=radial_significance)
    return Sighting(identity.mark, seen, centre, semi_axes, float(np.median(radius)), fit)


def _identify(
    centre: FloatArray, radius_px: FloatArray, world: FloatArray, quarter_turns: tuple[int, ...], enough: int
) -> MarkIdentity:
    """The first quarter turn that shows enough marks, else the one that shows most."""
    best = MarkIdentity(np.empty(0, np.int64), np.empty(0, np.int64))
    for turns in quarter_turns:
        cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns % 4]
        turn = np.array([[cosine, sine], [-sine, cosine]], dtype=np.float64)
        identity = identify_marks(centre @ turn, radius_px, world)
        if len(identity.mark) > len(best.mark):
            best = identity
        if len(best.mark) >= enough:
            break
    return best
