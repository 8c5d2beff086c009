"""Object span by the contract's definition."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.object_span import measurable_from_modulation, span_from_region, surface_at_centre


def region(width: int = 200, first: int = 50, last: int = 149) -> np.ndarray:
    shape = np.zeros((100, width), bool)
    shape[20:80, first : last + 1] = True
    return shape


def test_span_is_first_to_last_column_whatever_lies_between() -> None:
    shadowed = region()
    shadowed[:, 70:120] = False
    assert span_from_region(shadowed) == pytest.approx(0.5)


def test_span_is_the_95th_percentile_over_rows_that_have_any() -> None:
    shape = region()
    shape[79] = True  # 1 of 60 rows
    assert span_from_region(shape) == pytest.approx(0.5)
    shape[70:80] = True  # 10 of 60 rows
    assert span_from_region(shape) == pytest.approx(1.0)
    assert span_from_region(np.zeros((4, 4), bool)) == 0.0


def test_faint_reflexes_and_stray_pixels_do_not_count() -> None:
    rng = np.random.default_rng(2)
    modulation = np.where(region(), 30.0, 4.0)
    modulation[rng.random(modulation.shape) < 0.01] = 40.0
    found = measurable_from_modulation(modulation=modulation, noise_sigma=np.full(modulation.shape, 1.0))
    assert span_from_region(found) == pytest.approx(0.5, abs=0.02)


def test_surface_ends_at_a_depth_step() -> None:
    depth = np.where(np.arange(200) < 120, 10.0, 40.0)[None, :].repeat(100, axis=0)
    assert span_from_region(surface_at_centre(depth, largest_step=2.0)) == pytest.approx(0.6)
    assert span_from_region(surface_at_centre(depth, largest_step=50.0)) == pytest.approx(1.0)


def test_surface_nearest_to_the_centre_where_the_centre_is_a_hole() -> None:
    depth = np.full((100, 200), np.nan)
    depth[30:70, 20:60] = 5.0
    depth[30:70, 105:185] = 5.0
    assert span_from_region(surface_at_centre(depth, largest_step=1.0)) == pytest.approx(0.4)
    assert not surface_at_centre(np.full((5, 5), np.nan), largest_step=1.0).any()


def test_rows_left_out_at_the_stripes_do_not_part_a_surface() -> None:
    depth = np.linspace(0, 20, 100)[:, None].repeat(200, axis=1)
    for top in range(0, 100, 20):
        depth[top : top + 4] = np.nan
    parted = surface_at_centre(depth, largest_step=0.5)
    whole = surface_at_centre(depth, largest_step=0.5, bridged=4)
    assert parted.sum() == 16 * 200
    assert whole.sum() == np.isfinite(depth).sum()
    cliff = depth + np.where(np.arange(100) < 50, 0.0, 30.0)[:, None]
    assert surface_at_centre(cliff, largest_step=0.5, bridged=4).sum() < np.isfinite(depth).sum() * 0.6
