"""The projector's lens: one radial term, seen through the one coordinate that the phase names.

| name | symbol | meaning |
|---|---|---|
| radial | k1 | slide point − axis point = (ideal − axis)·(1 + k1·r²) |
| | r | tangent of a ray's angle off the optical axis |
| centre | C | (X, Y, Z) mm, centre of projection |
| turns at the axis | B | Φ/2π where the optical axis meets the slide |

The matrix's lower row is the optical axis f, so r² of a world point X is (|X − C|² − (f·(X − C))²)/(f·(X − C))², and B
is the upper row's share along it: the slide stands square to the axis, which meets it where the distortion is centred.
The phase then is y + (y − B)·k1·r², y the turns of the matrix alone, whichever way the stripes run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.triangulation import TURN, triangulate
from rahas.typing import AnyArray, FloatArray

_ROUNDS = 4  # each leaves about a fiftieth of the error of the one before


class Lens(NamedTuple):
    """A projector's radial term and what it needs to be applied."""

    radial: float
    """k1, 0 where the phase shows no distortion."""
    centre: FloatArray
    """(3,) mm."""


NO_LENS = Lens(0.0, np.zeros(3))
"""A projector without distortion."""


def squared_tangent(projector: FloatArray, centre: FloatArray, world: FloatArray) -> FloatArray:
    """r² (…) of world points (…, 3)."""
    axis = projector[1, :3] / np.linalg.norm(projector[1, :3])
    offset = world - centre
    depth2 = (offset @ axis) ** 2
    tangent2: FloatArray = np.maximum(np.sum(offset**2, axis=-1) - depth2, 0.0) / depth2
    return tangent2


def turns_at_axis(projector: FloatArray) -> float:
    """B, Φ/2π where the optical axis meets the slide."""
    top, bottom = projector[:, :3]
    return float(top @ bottom / (bottom @ bottom))


def phase_through_lens(projector: FloatArray, lens: Lens, world: FloatArray) -> FloatArray:
    """Unwrapped phase (…) in radians at world points (…, 3)."""
    top, bottom = np.moveaxis(world @ projector[:, :3].T + projector[:, 3], -1, 0)
    turns = top / bottom
    if lens.radial:
        turns = turns + (turns - turns_at_axis(projector)) * lens.radial * squared_tangent(
            projector, lens.centre, world
        )
    phase: FloatArray = TURN * turns
    return phase


def phase_without_lens(
    origin: FloatArray, direction: FloatArray, unwrapped_phase: AnyArray, projector: FloatArray, lens: Lens
) -> FloatArray:
    """Phase (…) that the matrix alone would show at the points that show ``unwrapped_phase`` (…), rad.

    The points lie on rays (…, 3) from ``origin``. Where a point lies depends on its phase, and its distortion on where
    it lies: fixed-point iterations.
    """
    seen = np.asarray(unwrapped_phase, dtype=np.float64)
    if not lens.radial:
        return seen
    at_axis = TURN * turns_at_axis(projector)
    plain = seen
    for _ in range(_ROUNDS):
        points = triangulate(origin, direction, plain, projector).points
        plain = at_axis + (seen - at_axis) / (1.0 + lens.radial * squared_tangent(projector, lens.centre, points))
    return plain


def slide_tangents(
    projector: FloatArray, first_stop: FloatArray, centre: FloatArray, world: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Where world points (n, 3) lie in the projector's field, and how fast its phases grow there.

    Tangents u along the stripes and v across them (n,) off the optical axis; radians per unit of u of the first stop's
    phase, and of v of the scan's, both signed.
    """
    length = float(np.linalg.norm(projector[1, :3]))
    axis = projector[1, :3] / length
    slope = projector[0, :3] / length - turns_at_axis(projector) * axis
    down = slope / np.linalg.norm(slope)
    along = np.cross(down, axis)
    offset = world - centre
    depth = offset @ axis
    first_length = float(np.linalg.norm(first_stop[1, :3]))
    first_slope = first_stop[0, :3] / first_length - turns_at_axis(first_stop) * first_stop[1, :3] / first_length
    return (
        offset @ along / depth,
        offset @ down / depth,
        TURN * float(first_slope @ along),
        TURN * float(np.linalg.norm(slope)),
    )


def projector_centre(projector: FloatArray, first_stop: FloatArray, near: FloatArray) -> FloatArray:
    """Centre of projection (3,) mm: where the planes of light through ``near`` (3,) meet the plane of the projector.

    ``first_stop`` (2, 4) gives Φ/2π at the slide's first stop, where the stripes run across those of ``projector``.
    """
    point = np.append(near, 1.0)

    def plane_at(matrix: FloatArray) -> FloatArray:
        plane: FloatArray = matrix[0] - (matrix[0] @ point) / (matrix[1] @ point) * matrix[1]
        return plane / np.linalg.norm(plane[:3])

    planes = np.stack([plane_at(projector), plane_at(first_stop), projector[1] / np.linalg.norm(projector[1, :3])])
    return np.linalg.solve(planes[:, :3], -planes[:, 3])


def centre_above_camera(projector: FloatArray, camera_centre: FloatArray, near: FloatArray) -> FloatArray:
    """The same where no first stop is known: level with the camera along the stripes."""
    along = np.cross(projector[0, :3], projector[1, :3])
    along /= np.linalg.norm(along)
    point = np.append(near, 1.0)
    plane = projector[0] - (projector[0] @ point) / (projector[1] @ point) * projector[1]
    rows = np.stack([plane[:3] / np.linalg.norm(plane[:3]), projector[1, :3] / np.linalg.norm(projector[1, :3]), along])
    right = [-plane[3] / np.linalg.norm(plane[:3]), -projector[1, 3] / np.linalg.norm(projector[1, :3])]
    return np.linalg.solve(rows, np.array([*right, along @ camera_centre]))
