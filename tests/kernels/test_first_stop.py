"""The first hold's image names phase to its noise: the projector at the first stop, and a change of it."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.first_stop import fit_first_stop, fit_phase_change
from rahas.kernels.hold_fit import HoldPixels, cells_of, hold_step
from rahas.kernels.projector import phase_of_projector
from rahas.kernels.projector_lens import NO_LENS
from rahas.kernels.rig_change import CHANGES, explain_change
from rahas.kernels.roof import fit_roof, points_on_roof
from rahas.kernels.triangulation import pixel_grid
from rahas.typing import FloatArray
from tests.roof_scene import HEIGHT, WIDTH, camera_at, first_stop_above, roof_target

PIXELS = pixel_grid(HEIGHT, WIDTH, step=4).reshape(-1, 2)
POINTS = points_on_roof(camera_at(), fit_roof(roof_target()), PIXELS)[0]
PHASE = phase_of_projector(first_stop_above(), POINTS)
X, Y = 2 * PIXELS[:, 0] / (WIDTH - 1) - 1, 2 * PIXELS[:, 1] / (HEIGHT - 1) - 1
COLUMNS = np.column_stack([np.ones_like(X), X, Y, X * X, X * Y, Y * Y])


def hold(phase: FloatArray, *, seed: int = 1, noise: float = 1.5) -> HoldPixels:
    """Pixels of a scan with other gain, ambient light, waveform and contrast than the hold has."""
    rng = np.random.default_rng(seed)
    a = 100.0 + 40.0 * np.sin(PIXELS[:, 0] / 17.0) * np.cos(PIXELS[:, 1] / 23.0)
    b = 0.6 * a
    wave = np.cos(phase) + 0.1 * np.cos(2 * phase + 0.4) + 0.03 * np.cos(3 * phase)
    level = 0.93 * a + 4.0 + 1.02 * b * wave + rng.normal(0, noise, a.size)
    return HoldPixels(level, a, b, cells_of(PIXELS[:, 1], PIXELS[:, 0], (HEIGHT, WIDTH)))


def test_matrix_comes_back_from_a_rough_start() -> None:
    rough = PHASE + 0.2 * np.sin(PIXELS[:, 0] / 40.0) + 4 * np.pi
    fit = fit_first_stop(hold(PHASE), POINTS, rough, NO_LENS)
    error = phase_of_projector(fit.matrix, POINTS) - PHASE - 4 * np.pi
    assert 1e-5 < np.sqrt(np.mean(error**2)) < 3e-3
    assert 0.015 < fit.residual_std < 0.035  # 1.5 grey levels over a modulation of about 60


def test_a_change_and_its_standard_deviation() -> None:
    truth = np.array([0.1, 0.02, -0.03, 0.01, 0.015, -0.01])
    found, predicted = [], []
    for seed in range(40):
        fit = fit_phase_change(hold(PHASE + COLUMNS @ truth, seed=seed), PHASE, COLUMNS, np.zeros(6))
        found.append(fit.terms)
        predicted.append(np.sqrt(np.diag(fit.covariance)))
    np.testing.assert_allclose(np.mean(found, axis=0), truth, atol=1e-3)
    ratio = np.std(found, axis=0, ddof=1) / np.median(predicted, axis=0)
    assert ratio.min() > 0.7
    assert ratio.max() < 1.4


def test_dirt_in_the_image_does_not_pull() -> None:
    pixels = hold(PHASE + 0.1)
    rng = np.random.default_rng(5)
    spoiled = pixels.level + np.where(rng.random(PHASE.size) < 0.08, rng.normal(40, 60, PHASE.size), 0.0)
    fit = fit_phase_change(pixels._replace(level=spoiled), PHASE, COLUMNS, np.zeros(6))
    assert abs(float((COLUMNS @ fit.terms).mean()) - 0.1) < 4e-3


def test_an_image_without_the_stripes_is_refused() -> None:
    pixels = hold(PHASE)
    flat = pixels._replace(level=pixels.background + np.random.default_rng(2).normal(0, 2, PHASE.size))
    with pytest.raises(ValueError, match="does not show"):
        fit_phase_change(flat, PHASE, COLUMNS, np.zeros(6))
    few = HoldPixels(*(values[:40] for values in pixels))
    with pytest.raises(ValueError, match="40 pixels"):
        hold_step(few, PHASE[:40], COLUMNS[:40])


SIZES = {
    "slide_shift": 0.1,
    "projector_yaw": 2e-3,
    "projector_pitch": 2e-3,
    "projector_roll": 3e-3,
    "projector_zoom": 4e-3,
    "camera_zoom": 5e-3,
}
FIRST_RATE, RATE = 250.0, 240.0


@pytest.mark.parametrize("cause", [None, *CHANGES])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_change_is_told_from_the_others(cause: str | None, sign: float) -> None:
    u, v = 0.25 * X, 0.2 * Y + 0.02
    size = sign * SIZES.get(cause or "", 0.0)
    moved_u = {
        "projector_yaw": np.tan(np.arctan(u) + size) - u,
        "projector_pitch": u / (np.cos(size) - v * np.sin(size)) - u,
        "projector_roll": u * np.cos(size) - v * np.sin(size) - u,
        "projector_zoom": u * size,
        "camera_zoom": -size * (u + 0.3 * u * v),
    }
    moved_v = {
        "projector_yaw": v / (np.cos(size) - u * np.sin(size)) - v,
        "projector_pitch": np.tan(np.arctan(v) + size) - v,
        "projector_roll": u * np.sin(size) + v * np.cos(size) - v,
        "projector_zoom": v * size,
        "camera_zoom": -size * (v - 0.02 + 0.3 * v * v),
    }
    first = FIRST_RATE * moved_u.get(cause or "", 0.0 * u) + (size if cause == "slide_shift" else 0.0)
    scan = RATE * moved_v.get(cause or "", 0.0 * v) + (size if cause == "slide_shift" else 0.0)
    noise = np.random.default_rng(3).normal(0, 1e-3, 6)
    terms = np.linalg.lstsq(COLUMNS, first, rcond=None)[0] + noise
    change = explain_change(
        terms,
        1e-6 * np.eye(6),
        COLUMNS,
        u,
        v,
        camera_zoom=(-FIRST_RATE * (u + 0.3 * u * v), -RATE * (v - 0.02 + 0.3 * v * v)),
        followed=np.zeros_like(u),
        per_tangent_first=FIRST_RATE,
        per_tangent=RATE,
    )
    believed = [name for name, value in zip(CHANGES, change.size, strict=True) if value]
    assert believed == ([] if cause is None else [cause])
    if cause is not None:
        assert change.size[CHANGES.index(cause)] == pytest.approx(size, rel=0.2)
    added = change.phase_of_each.sum(axis=1)
    assert np.sqrt(np.mean((added - scan) ** 2)) <= 0.2 * np.sqrt(np.mean(scan**2)) + 0.01
