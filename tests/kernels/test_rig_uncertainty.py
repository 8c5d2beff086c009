"""Every parameter's standard deviation is what repeated calibrations scatter."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.first_stop import fit_first_stop
from rahas.kernels.hold_fit import HoldPixels, cells_of
from rahas.kernels.projector import fit_projector
from rahas.kernels.projector_lens import Lens, phase_through_lens
from rahas.kernels.radial_profile import fit_radial
from rahas.kernels.rig_uncertainty import rig_covariance
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid
from tests.roof_scene import (
    HEIGHT,
    WIDTH,
    camera_at,
    first_stop_above,
    marks_in_image,
    projector_above,
    projector_place,
    roof_target,
)

REPEATS = 40
TARGET, ROOF = roof_target(), fit_roof(roof_target())
PIXELS = pixel_grid(HEIGHT, WIDTH, step=16).reshape(-1, 2)  # few enough to count each as a measurement of its own
CAMERA, PROJECTOR, FIRST = camera_at(radial=-2.1e-7), projector_above(), first_stop_above()


def one_calibration(rng: np.random.Generator, radial: float) -> tuple[np.ndarray, np.ndarray]:
    """Parameters and their predicted standard deviations."""
    lens = Lens(radial, projector_place())
    points, _ = points_on_roof(CAMERA, ROOF, PIXELS)
    phase = phase_through_lens(PROJECTOR, lens, points) + rng.normal(0, 0.02, len(PIXELS))
    seen = marks_in_image(CAMERA) + rng.normal(0, 0.03, (18, 2))
    fit = fit_radial(
        TARGET, seen, ROOF, PIXELS, phase, PROJECTOR, centre=CAMERA.centre, start=CAMERA.radial, significance=1.0,
        projector_lens=lens if radial else None,
    )  # fmt: skip
    own = lens._replace(radial=fit.projector_radial)
    named, _ = points_on_roof(fit.camera.camera, ROOF, PIXELS)
    found = fit_projector(named, phase, start=PROJECTOR, gate=8.0, lens=own)
    truth = phase_through_lens(FIRST, lens, points)
    level = 100.0 + 60.0 * np.cos(truth) + rng.normal(0, 1.5, len(PIXELS))
    cells = cells_of(PIXELS[:, 1], PIXELS[:, 0], (HEIGHT, WIDTH))
    pixels = HoldPixels(level, np.full(len(level), 100.0), np.full(len(level), 60.0), cells)
    first = fit_first_stop(pixels, named, truth, own)
    covariance = rig_covariance(
        fit.camera,
        ROOF,
        PIXELS,
        found.matrix,
        found.covariance,
        reach_mm=TARGET,
        lens=own,
        lens_covariance=fit.covariance,
        first_stop=first,
    )
    camera = fit.camera.camera
    values = [
        camera.matrix.ravel()[:11],
        [camera.radial],
        found.matrix.ravel()[:7],
        [own.radial],
        first.matrix.ravel()[:7],
    ]
    return np.concatenate(values), np.sqrt(np.diag(covariance))


@pytest.mark.parametrize("radial", [0.0, 0.06])
def test_scatter_of_every_parameter(radial: float) -> None:
    rng = np.random.default_rng(11)
    values, predicted = zip(*(one_calibration(rng, radial) for _ in range(REPEATS)), strict=True)
    ratio = np.std(values, axis=0, ddof=1) / np.maximum(np.median(predicted, axis=0), 1e-300)
    fitted = np.arange(27) != (19 if radial == 0 else -1)
    print(np.round(ratio, 2))
    assert ratio[fitted].min() > 0.7
    assert ratio[fitted].max() < 1.4
    assert (np.array(predicted)[:, ~fitted] == 0).all()
