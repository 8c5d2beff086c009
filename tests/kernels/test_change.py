"""Known changes of depth and phase come back as the figures that they are."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.change import DepthChange, depth_change, phase_change

SHAPE = (60, 80)


def depths(after: np.ndarray, before: np.ndarray, *, std: tuple[float, float] = (0.03, 0.04)) -> DepthChange:
    return depth_change(
        before_mm=before,
        after_mm=after,
        before_std_mm=np.full(SHAPE, std[0], np.float32),
        after_std_mm=np.full(SHAPE, std[1], np.float32),
    )


@pytest.fixture
def surface() -> np.ndarray:
    y, x = np.indices(SHAPE, dtype=np.float32)
    return 20 * np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 800)


def test_a_shift_in_mm_and_in_sigmas(surface: np.ndarray) -> None:
    change = depths(surface - np.float32(0.1), surface)
    assert change.compared == surface.size
    assert (change.gained, change.lost) == (0, 0)
    assert change.median_mm == pytest.approx(-0.1, abs=2e-6)
    assert change.rms_mm == pytest.approx(0.1, abs=2e-6)
    assert change.p95_mm == pytest.approx(0.1, abs=2e-6)
    for sigmas in (change.median_sigmas, change.rms_sigmas, change.p95_sigmas):
        assert sigmas == pytest.approx(0.1 / 0.05, abs=1e-4)


def test_noise_has_its_rms_and_percentile(surface: np.ndarray) -> None:
    noise = np.random.default_rng(5).normal(0, 0.2, SHAPE)
    change = depths(surface + noise, surface)
    assert change.rms_mm == pytest.approx(0.2, rel=0.03)
    assert change.p95_mm == pytest.approx(1.96 * 0.2, rel=0.05)
    assert abs(change.median_mm) < 0.01


def test_points_gained_and_lost(surface: np.ndarray) -> None:
    before, after = surface.copy(), surface.copy()
    before[:10] = np.nan
    after[:, :8] = np.nan
    change = depths(after, before)
    assert (change.compared, change.gained, change.lost) == (50 * 72, 10 * 72, 50 * 8)
    assert np.isfinite(change.difference_mm).sum() == change.compared
    assert change.rms_mm == 0.0


def test_where_no_sigma_is_known_none_is_told(surface: np.ndarray) -> None:
    change = depths(surface + 1, surface, std=(0.0, 0.0))
    assert change.rms_mm == pytest.approx(1.0, abs=1e-6)
    assert np.isnan([change.median_sigmas, change.rms_sigmas, change.p95_sigmas]).all()


def test_nothing_in_common(surface: np.ndarray) -> None:
    change = depths(surface, np.full(SHAPE, np.nan))
    assert (change.compared, change.gained, change.lost) == (0, surface.size, 0)
    assert np.isnan([change.median_mm, change.rms_mm, change.p95_mm, change.p95_sigmas]).all()


def test_orders_changed_on_a_known_share() -> None:
    before = np.broadcast_to(np.linspace(-9, 40, SHAPE[0])[:, None], SHAPE).copy()
    after = before + 0.01
    after[:6, :20] += 2 * np.pi
    after[6:9, :20] -= 4 * np.pi
    after[-1] = np.nan
    change = phase_change(before_rad=before, after_rad=after)
    assert change.compared == 59 * 80
    assert change.orders_changed == 9 * 20
    assert change.rms_rad == pytest.approx(0.01, abs=1e-9)


def test_a_wrapped_phase_that_noise_carries_across_is_no_order_changed() -> None:
    before = np.full(SHAPE, np.pi - 0.001)
    change = phase_change(before_rad=before, after_rad=before + 0.002)
    assert change.orders_changed == 0
    assert change.rms_rad == pytest.approx(0.002, abs=1e-12)


def test_other_grids_are_refused(surface: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"\(60, 80\) before, \(59, 80\) after"):
        phase_change(before_rad=surface, after_rad=surface[1:])
