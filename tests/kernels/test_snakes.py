"""Labels, chains, tracking, growth and prediction on drawn stripes."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.peaks import PeakRule, Peaks, snake_mask_peak_psr
from rahas.kernels.snake_chains import chains_of_peaks, names_added, names_by_vote
from rahas.kernels.snake_growth import GrowthRule, drop_contradictions, multi_pass_grow
from rahas.kernels.snake_labels import first_names, first_positions, init_to_snake, stripe_numbers
from rahas.kernels.snake_light import LEVEL_OFFSET
from rahas.kernels.snake_prediction import NO_NAME, first_prediction, predicted, without_contradicted
from rahas.kernels.snake_tracking import (
    MEMORY_FRAMES,
    STILL,
    memory_of_rows,
    motion_of_snakes,
    multi_pass_track_delta_y,
    remembered,
    track_snakes,
)
from rahas.kernels.snakes import blank_snakes, rows_from_names, snake_set_from_rows
from rahas.kernels.unrotation import canvas_columns, canvas_matrix, image_matrix, unrotation_deg_from_slide_angle

PITCH = 16.0
RULE = PeakRule(sidelobe_px=6, min_psr=1.25, min_level=2.3, half_window_px=2, min_separation_px=5.6)
GROWTH = GrowthRule(
    PITCH,
    gap_px=5,
    reach_px=1.6,
    min_spacing=0.4,
    max_spacing=2.2,
    grow_min_spacing=0.6,
    grow_max_spacing=1.7,
    min_length_px=8,
)


def drawn(*, first: float = 10.0, slope: float = 0.0, shape: tuple[int, int] = (120, 140)) -> np.ndarray:
    """Canvas columns (x, y) with maxima at first + slope·(x − 60) + n·PITCH."""
    x, y = np.mgrid[: shape[0], : shape[1]]
    return (LEVEL_OFFSET + np.cos(2 * np.pi * (y - first - slope * (x - 60)) / PITCH)).astype(np.float32)


def peaks_of(columns: np.ndarray) -> Peaks:
    return snake_mask_peak_psr(columns, RULE)


def test_first_labels_number_all_stripes_across_a_shadow() -> None:
    columns = drawn(slope=0.02)
    columns[70:90] = 0  # a shadow from top to bottom
    columns[40:80, 55:75] = 0  # and one over the middle, where the search begins
    peaks = peaks_of(columns)
    chains = chains_of_peaks(peaks, reach_px=1.5)
    names = first_names(peaks, chains, pitch_px=PITCH)
    x, slot = np.nonzero(np.isfinite(peaks.y))
    true = np.rint((peaks.y[x, slot] - 10.0 - 0.02 * (x - 60)) / PITCH) + 1
    assert np.array_equal(names[x, slot], true)
    positions = first_positions(names, peaks, snakes=12)
    assert np.allclose(positions[:8], 10.0 + PITCH * np.arange(8), atol=0.2)
    assert np.isnan(positions[9:]).all()
    between = stripe_numbers(names, peaks, np.array([60.0]), np.array([10.0 + 2.5 * PITCH]))
    assert between[0] == pytest.approx(3.5, abs=0.02)


def test_a_stripe_hidden_at_the_middle_keeps_its_number_free() -> None:
    columns = drawn(shape=(20, 140))
    columns[:, 10 + 2 * 16 - 8 : 10 + 2 * 16 + 8] = 0
    peaks = peaks_of(columns)
    seeds = init_to_snake(peaks, pitch_px=PITCH)
    assert sorted(set(seeds[seeds > 0].tolist())) == [1001, 1002, 1004, 1005, 1006, 1007, 1008]


def test_no_stripes_no_names() -> None:
    peaks = peaks_of(np.full((60, 100), LEVEL_OFFSET, np.float32))
    assert not first_names(peaks, chains_of_peaks(peaks, reach_px=1.5), pitch_px=PITCH).any()


def test_chains_end_at_jumps_and_take_the_name_of_the_majority() -> None:
    columns = drawn()
    columns[60:] = drawn(first=15.0)[60:]
    peaks = peaks_of(columns)
    chains = chains_of_peaks(peaks, reach_px=2.0)
    assert set(chains.last[chains.first == 0]) == {59}
    votes = np.zeros(peaks.y.shape, np.int16)
    votes[:59, 0] = 1
    votes[20, 0] = 2
    votes[:30, 1], votes[30:59, 1] = 2, 3
    names = names_by_vote(chains, votes, min_agreement=0.8)
    assert np.all(names[:60, 0] == 1)
    assert np.array_equal(names[:59, 1], votes[:59, 1])  # no majority: as they were voted
    assert not names[60:].any()
    wanted = np.zeros_like(votes)
    wanted[60:, :2] = 7
    wanted[60:80, 1] = 0
    added = names_added(chains, names, wanted, min_share=0.7, min_length_px=8)
    assert np.all(added[60:, 0] == 7)
    assert not added[60:, 1].any()  # 40 of 60 pixels only
    assert np.array_equal(added[:60], names[:60])


def test_tracking_follows_a_common_motion_of_almost_half_a_pitch() -> None:
    first = peaks_of(drawn())
    slots = np.arange(1, first.y.shape[1] + 1, dtype=np.int16)
    before = rows_from_names(first, np.where(np.isfinite(first.y), slots, 0), 9)
    peaks = peaks_of(drawn(first=15.0, slope=0.02))
    names, motion = track_snakes(before, peaks, wide_px=0.45 * PITCH, narrow_px=0.3 * PITCH)
    x, slot = np.nonzero(names)
    assert x.size > 0.9 * np.isfinite(before).sum()
    true = np.rint((peaks.y[x, slot] - 15.0 - 0.02 * (x - 60)) / PITCH) + 1
    assert np.array_equal(names[x, slot], true)
    assert motion.per_x == pytest.approx(0.02, abs=0.002)
    assert motion.offset + 60 * motion.per_x == pytest.approx(5.0, abs=0.1)


def test_a_peak_that_two_snakes_claim_is_kept_by_neither_pass() -> None:
    before = np.full((2, 1), np.nan, np.float32)
    before[:, 0] = 40, 48
    one = Peaks(np.zeros((1, 140), np.uint8), np.array([[44.0]], np.float32), np.array([1], np.int32))
    assert not multi_pass_track_delta_y(before, one, STILL, reach_px=5.0).any()
    assert motion_of_snakes(before, one, np.ones((1, 1), np.int16)) == STILL


def test_lost_pixels_are_remembered_for_a_while_and_bad_frames_do_not_count() -> None:
    rows = np.full((2, 10), 30.0, np.float32)
    memory = memory_of_rows(rows)
    half = rows.copy()
    half[0, :5] = np.nan
    for _ in range(MEMORY_FRAMES):
        memory = remembered(memory, half, STILL)
        assert np.isfinite(memory.y).all()
    nothing = np.full_like(rows, np.nan)
    assert remembered(memory, nothing, STILL) is memory
    memory = remembered(memory, half, STILL)
    assert np.isnan(memory.y[0, :5]).all()
    assert np.isfinite(memory.y).sum() == 15


def test_growth_jumps_a_small_gap_but_not_against_the_order() -> None:
    columns = drawn()
    columns[60:63] = 0
    peaks = peaks_of(columns)
    chains = chains_of_peaks(peaks, reach_px=1.5)
    names = np.zeros(peaks.y.shape, np.int16)
    names[:60, :8] = np.arange(1, 9)
    grown = multi_pass_grow(peaks, chains, names, GROWTH, snakes=8)
    assert np.array_equal(grown[63:, :8], np.tile(np.arange(1, 9), (57, 1)))
    names[63:, 2] = 2  # beyond the gap the third stripe is known to be the second: a depth step
    grown = multi_pass_grow(peaks, chains, names, GROWTH, snakes=8)
    assert np.all(grown[63:, 2] == 2)
    assert not np.any(grown[63:, 1] >= 2)
    assert not np.any(grown[63:, 3] == 4)


def test_a_stripe_that_enters_below_is_named_by_its_neighbours_and_one_above_the_first_is_not() -> None:
    peaks = peaks_of(drawn())
    chains = chains_of_peaks(peaks, reach_px=1.5)
    names = np.zeros(peaks.y.shape, np.int16)
    names[:, 1:4] = 1, 2, 3
    grown = multi_pass_grow(peaks, chains, names, GROWTH, snakes=6)
    assert np.array_equal(grown[50, :8], [0, 1, 2, 3, 4, 5, 6, 0])


def test_contradictions_lose_the_weaker_name() -> None:
    peaks = peaks_of(drawn())
    chains = chains_of_peaks(peaks, reach_px=1.5)
    names = np.zeros(peaks.y.shape, np.int16)
    names[:, :8] = np.arange(1, 9)
    names[:50, 4] = 3
    names[50:, 4] = 0
    kept = drop_contradictions(peaks, chains, names, GROWTH)
    assert not kept[:, 4].any()
    assert np.array_equal(np.delete(kept, 4, axis=1), np.delete(names, 4, axis=1))


def test_prediction_learns_a_step_of_two_stripes_cell_by_cell() -> None:
    height, width, pitch = 90, 120, 12.0
    y, x = np.mgrid[:height, :width].astype(float)
    aligned = (x - 58) / pitch + 5
    across = (y - 44.5) / pitch + np.where(x > 70, 2.0, 0.0)
    state = first_prediction(aligned[::2, ::2], cell_px=2, pitch_px=pitch)
    for angle in np.r_[np.zeros(3), np.linspace(0, 90, 60), np.full(5, 90.0)]:
        turn = np.deg2rad(angle)
        stripe = aligned * np.cos(turn) + across * np.sin(turn) + 0.3 * np.sin(turn)
        levels = (LEVEL_OFFSET + np.cos(2 * np.pi * stripe)).astype(np.float32)
        state = predicted(state, levels, slide_angle_deg=angle + 2.0)
    error = state.stripe - stripe[::2, ::2]
    assert state.sure.mean() > 0.9
    right = np.abs(error[state.sure]) < 0.25
    assert right.mean() > 0.97
    assert np.array_equal(without_contradicted(np.array([1, 2, 3]), np.array([1, 3, NO_NAME])), [1, 0, 3])


@pytest.mark.parametrize("angle", [90.0, 37.0, -90.0])
def test_canvas_maps_points_as_the_architecture_says(angle: float) -> None:
    height, width = 41, 61
    image = np.zeros((height, width), np.float32)
    image[18, 35] = 1  # p = (5, −2) from the centre (30, 20)
    columns = canvas_columns(image, angle)
    turn = np.deg2rad(angle)
    seen = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ [5, -2] + [30, 20]
    weight = columns / columns.sum()
    centre = [(weight.sum(axis=1) * np.arange(width)).sum(), (weight.sum(axis=0) * np.arange(height)).sum()]
    assert np.allclose(centre, seen, atol=0.15)  # bilinear in 1/32 pixels
    there, back = (m(angle, height=height, width=width) for m in (canvas_matrix, image_matrix))
    assert np.allclose(back @ [*(there @ [35, 18, 1]), 1], [35, 18])


def test_unrotation_of_both_senses() -> None:
    assert unrotation_deg_from_slide_angle(np.array([0.0, 90.0, np.nan]), rotation_sense=-1)[:2].tolist() == [-90, 0]
    with pytest.raises(ValueError, match="rotation_sense"):
        unrotation_deg_from_slide_angle(np.zeros(1), rotation_sense=0)


def test_snake_set_looks_its_values_up_in_the_image() -> None:
    frame = np.arange(80 * 120, dtype=np.float32).reshape(80, 120)
    y = np.full((3, 120), np.nan, np.float32)
    y[1, 50] = 30.2
    found = snake_set_from_rows(y, frame, 90.0)
    assert found.identity[1, 50] == 2
    assert np.count_nonzero(found.identity) == 1
    image = image_matrix(90.0, height=80, width=120) @ [50, 30.2, 1]
    assert found.value[1, 50] == frame[round(image[1]), round(image[0])]
    assert not blank_snakes(3, 120).identity.any()
