"""Peaks of un-rotated frames."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.peaks import (
    PEAK,
    TRANSITION,
    PeakRule,
    angle_psr,
    collapse_slice,
    find_collapse_peaks,
    snake_mask_peak_psr,
)
from rahas.kernels.stripe_count import find_num_snakes

RULE = PeakRule(sidelobe_px=8, min_psr=1.25, min_level=2.3, half_window_px=3, min_separation_px=7.0)


def stripes(pitch: float = 20.0, first: float = 7.3, shape: tuple[int, int] = (40, 200)) -> np.ndarray:
    """Canvas columns (x, y) of levels 1…3 with maxima at first + 0.1·x + n·pitch."""
    x, y = np.mgrid[: shape[0], : shape[1]]
    return (2 + np.cos(2 * np.pi * (y - first - 0.1 * x) / pitch)).astype(np.float32)


def test_peaks_lie_on_the_maxima_to_a_twentieth_of_a_pixel() -> None:
    peaks = snake_mask_peak_psr(stripes(), RULE)
    for x in (0, 17, 39):
        found = peaks.y[x, : peaks.counts[x]]
        true = 7.3 + 0.1 * x + 20 * np.arange(10)
        assert np.allclose(found, true[(true > 3) & (true < 196)], atol=0.05)
    assert np.isnan(peaks.y[0, peaks.counts[0] :]).all()


def test_mask_is_trinary_with_one_peak_a_run() -> None:
    mask = snake_mask_peak_psr(stripes(), RULE).mask
    assert set(np.unique(mask)) == {0, TRANSITION, PEAK}
    column = mask[5]
    starts = np.flatnonzero((column[1:] > 0) & (column[:-1] == 0)) + 1
    for start in starts:
        stop = start + int(np.argmin(column[start:])) if (column[start:] == 0).any() else column.size
        assert (column[start:stop] == PEAK).sum() == 1


def test_thresholds_of_the_mask_are_those_of_the_psr_image() -> None:
    columns = stripes() + np.random.default_rng(1).normal(0, 0.05, (40, 200)).astype(np.float32)
    wanted = (angle_psr(columns, RULE.sidelobe_px) >= RULE.min_psr) & (columns >= np.float32(RULE.min_level))
    mask = snake_mask_peak_psr(columns, RULE).mask
    assert (wanted != (mask > 0)).mean() < 1e-3  # float32 beside float64 at the threshold


def test_psr_of_a_cosine() -> None:
    columns = stripes(first=10.0, shape=(1, 60))
    psr = angle_psr(columns, 10)
    assert psr[0, 30] == pytest.approx(3.0)
    assert psr[0, 20] == pytest.approx(1 / 3)
    assert psr[0, 10] == pytest.approx(3.0)


def test_nothing_is_found_where_nothing_is_seen() -> None:
    columns = stripes()
    columns[10:20] = 0
    columns[20:, 100:] = 0
    peaks = snake_mask_peak_psr(columns, RULE)
    assert not peaks.mask[10:20].any()
    assert not peaks.counts[10:20].any()
    assert np.nanmax(peaks.y[20:]) < 100 - RULE.half_window_px
    assert peaks.counts[30] == 5


def test_of_two_maxima_that_are_too_close_the_brighter_one_stays() -> None:
    y = np.arange(60.0)
    column = 1 + 1.8 * np.exp(-(((y - 25) / 2) ** 2)) + 1.6 * np.exp(-(((y - 31) / 2) ** 2))
    peaks = snake_mask_peak_psr(column[None].astype(np.float32), RULE._replace(half_window_px=1, sidelobe_px=9))
    assert peaks.counts[0] == 1
    assert peaks.y[0, 0] == pytest.approx(25, abs=0.2)


def test_collapse_finds_the_stripes_of_the_middle() -> None:
    mask = snake_mask_peak_psr(stripes(), RULE).mask
    rows = np.flatnonzero(find_collapse_peaks(collapse_slice(mask, 20, 4)))
    assert np.abs(rows - (9.3 + 20 * np.arange(10))[: rows.size]).max() <= 1
    assert rows.size == 10


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0, 2, 0], [1]), ([0, 2, 2, 0], [1]), ([0, 2, 2, 2, 0], [2]), ([0, 2, 2, 2, 2, 0], []), ([1, 2, 3], [2])],
)
def test_plateaus(values: list[int], expected: list[int]) -> None:
    assert np.flatnonzero(find_collapse_peaks(np.array(values))).tolist() == expected


@pytest.mark.parametrize("pitch", [9.0, 20.0, 33.3])
def test_stripe_count_by_fft(pitch: float) -> None:
    counted = find_num_snakes(stripes(pitch=pitch, shape=(120, 200)) - 2)
    assert counted.pitch_px == pytest.approx(pitch, rel=0.02)
    assert abs(counted.stripes - 200 / pitch) <= 1
    assert counted.strength > 100


def test_stripe_count_needs_room() -> None:
    with pytest.raises(ValueError, match="canvas rows"):
        find_num_snakes(np.zeros((50, 50)))
