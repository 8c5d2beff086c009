"""The first hold against the calibration's first stop, on scenes drawn from their equations."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.projector import phase_of_projector
from rahas.kernels.projector_lens import Lens, phase_through_lens
from rahas.kernels.triangulation import pixel_grid, rays_of_camera, triangulate
from rahas.stages.consistency import Consistency, check_consistency
from rahas.stages.first_hold import FirstHold, first_hold_of
from rahas.stages.rig import ImagingCamera, Rig
from rahas.stages.rotation_frames import Rotation
from tests.roof_scene import HEIGHT, WIDTH, camera_at, first_stop_above, projector_above, projector_place, see_relief

CAMERA, PROJECTOR, FIRST = camera_at(), projector_above(), first_stop_above()
SCENE = see_relief(CAMERA, PROJECTOR)
RIG = Rig(
    ImagingCamera(CAMERA, WIDTH, HEIGHT), PROJECTOR, None, np.zeros((27, 27)), Lens(0.0, projector_place()), FIRST
)


def compared(
    shift: float = 0.0, *, rig: Rig = RIG, lens: Lens | None = None, hold: FirstHold | None = None
) -> Consistency | None:
    """A scan whose slide sits ``shift`` rad beside the calibration's."""
    rng = np.random.default_rng(4)
    own = lens or RIG.lens
    background = 100.0 + 30.0 * np.sin(SCENE.points[..., 0] / 6.0)
    level = 1.05 * background + 60.0 * np.cos(phase_through_lens(FIRST, own, SCENE.points) + shift)
    level += rng.normal(0, 1.0, level.shape)
    unwrapped = phase_through_lens(PROJECTOR, own, SCENE.points) + shift + rng.normal(0, 0.01, level.shape)
    unwrapped[:, :15] = np.nan
    return check_consistency(
        rig,
        hold or FirstHold(level.astype(np.float32), 1),
        unwrapped_phase=unwrapped,
        background=background,
        modulation=np.full(level.shape, 60.0),
    )


@pytest.mark.parametrize("shift", [0.05, 0.1, -0.3, 1.0])
def test_shift_of_the_slide_in_radians_and_mm(shift: float) -> None:
    found = compared(shift)
    assert found is not None
    assert found.offset_rad == pytest.approx(shift, abs=2e-3)
    assert found.cause == "slide_shift"
    origin, direction = rays_of_camera(CAMERA, pixel_grid(HEIGHT, WIDTH))
    true = phase_of_projector(PROJECTOR, SCENE.points)
    moved = triangulate(origin, direction, true + shift, PROJECTOR).points - SCENE.points
    assert found.depth_mm == pytest.approx(float(np.sqrt(np.mean(moved[..., 2] ** 2))), rel=0.05)


def test_an_untouched_rig() -> None:
    found = compared()
    assert found is not None
    assert abs(found.offset_rad) < 3.0 * found.offset_std_rad + 1e-4
    assert found.gradient_rad < 3.0 * found.gradient_std_rad + 1e-3
    assert (found.cause, found.depth_mm) == ("", 0.0)


def test_the_projectors_lens_is_taken_into_account() -> None:
    lens = Lens(0.06, projector_place())
    found = compared(rig=RIG._replace(lens=lens), lens=lens)
    assert found is not None
    assert found.gradient_rad < 2e-3
    ignored = compared(lens=lens)
    assert ignored is not None
    assert ignored.gradient_rad > 0.02


def test_the_calibrations_own_uncertainty_counts() -> None:
    covariance = np.zeros((27, 27))
    covariance[23, 23] = (2e-3 / FIRST[1, 3] / 2 / np.pi) ** 2  # first stop's m8: a constant phase but for perspective
    sure, unsure = compared(), compared(rig=RIG._replace(covariance=covariance))
    assert sure is not None
    assert unsure is not None
    assert 1.5e-3 < np.sqrt(unsure.offset_std_rad**2 - sure.offset_std_rad**2) < 3e-3


def test_without_a_hold_nothing_is_said() -> None:
    assert compared(rig=RIG._replace(first_stop=None)) is None
    assert compared(hold=FirstHold(np.full((HEIGHT, WIDTH), 90.0, np.float32), 1)) is None
    assert compared(hold=FirstHold(np.full((HEIGHT // 2, WIDTH), 90.0, np.float32), 1)) is None


def test_frames_of_the_hold_that_stand_still() -> None:
    frames = np.full((60, 24, 32), 50, np.uint8)
    frames[:] += np.random.default_rng(1).integers(0, 3, frames.shape, dtype=np.uint8)
    frames[10:13] += 60  # the lamp warms up
    frames[38:] += 40  # the lever starts within the hold's last frames
    frames[25] += 90  # a flash
    angle = np.full(60, np.nan)
    hold = first_hold_of(frames, Rotation(41, 55, (10, 40), angle, 1))
    assert hold is not None
    assert hold.level.mean() == pytest.approx(51.0, abs=0.1)
    assert first_hold_of(frames, Rotation(10, 55, (10, 10), angle, 1)) is None
