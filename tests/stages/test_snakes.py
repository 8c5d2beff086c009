"""Tracking on rendered captures: rows, identities and coverage against truth."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.params import SnakesParams
from rahas.stages.snakes import BLOCK_FRAMES, snake_timeline, track
from tests.stages.snake_scene import Capture, Score, film, scene, score

PARAMS = SnakesParams()


def tracked(shot: Capture, *, angle_error_deg: float = 0.0, jitter_deg: float = 0.0) -> Score:
    angles = shot.timeline.slide_angle_deg + angle_error_deg
    angles = angles + np.random.default_rng(5).normal(0, jitter_deg, angles.shape)
    result = track(shot.frames, shot.timeline._replace(slide_angle_deg=angles), PARAMS)
    return score(shot, list(result.blocks), result.unrotation_deg, result.pitch_px)


@pytest.mark.parametrize(
    ("relief", "rise", "sense"), [("flat", 0.0, 1), ("wave", 0.8, -1), ("step", 0.4, 1), ("block", 0.4, 1)]
)
def test_every_stripe_is_followed_from_the_first_hold_to_the_end(relief: str, rise: float, sense: int) -> None:
    result = tracked(film(scene(relief, rise=rise), sense=sense))
    assert result.wrong == 0
    assert result.p95_px <= 0.6
    assert result.coverage.min() >= 0.85
    assert result.coverage.max() <= 1.05
    assert result.topmost[0] == 1


@pytest.mark.parametrize(("relief", "rise"), [("step", 1.0), ("block", 1.0), ("block", 1.6)])
def test_depth_steps_of_a_stripe_and_more_do_not_swap_identities(relief: str, rise: float) -> None:
    """At phase alignment each stripe goes on beyond the step as if it were the next one."""
    result = tracked(film(scene(relief, rise=rise)))
    assert result.wrong <= 0.005
    assert result.coverage.min() >= 0.7


def test_angles_that_are_wrong_and_uneven_do_no_harm() -> None:
    result = tracked(film(scene("wave", rise=0.6)), angle_error_deg=3.0, jitter_deg=0.7)
    assert result.wrong == 0
    assert result.p95_px <= 0.7
    assert result.coverage.min() >= 0.85


def test_portrait_frames() -> None:
    result = tracked(film(scene("wave", height=240, width=180, rise=0.6)))
    assert result.wrong == 0
    assert result.coverage.min() >= 0.85


def test_lever_of_two_degrees_and_more_a_frame_and_doubled_frames() -> None:
    shot = film(scene("wave", rise=0.6))
    first, last = shot.timeline.moving[0]
    kept = np.sort(np.r_[np.arange(len(shot.frames)), np.arange(first, last, 5)])
    gone = len(shot.frames) - len(kept)
    speed = np.diff(shot.timeline.slide_angle_deg[kept][first : last - gone])
    assert speed.max() > 2.0
    assert speed.min() == 0.0
    timeline = shot.timeline
    fast = Capture(
        shot.frames[kept],
        shot.phase[kept],
        timeline._replace(
            slide_angle_deg=timeline.slide_angle_deg[kept],
            lit=timeline.lit[kept],
            second_hold=(timeline.second_hold[0] - gone, timeline.second_hold[1] - gone),
            moving=((first, last - gone), (timeline.moving[1][0] - gone, timeline.moving[1][1] - gone)),
        ),
        shot.edge,
    )
    result = tracked(fast)
    assert result.wrong == 0
    assert result.coverage.min() >= 0.85


def test_little_light() -> None:
    result = tracked(film(scene("wave", rise=0.6), level=7.0))
    assert result.wrong <= 0.001
    assert result.p95_px <= 1.2
    assert result.coverage.mean() >= 0.6


def test_dark_frames_are_blank_and_blocks_cover_the_capture() -> None:
    shot = film(scene("flat"))
    result = track(shot.frames, shot.timeline, PARAMS)
    blocks = list(result.blocks)
    assert [b.first_frame for b in blocks] == list(range(0, len(shot.frames), BLOCK_FRAMES))
    identity = np.concatenate([b.identity for b in blocks])
    y = np.concatenate([b.y for b in blocks])
    value = np.concatenate([b.value for b in blocks])
    assert identity.shape == y.shape == value.shape == (len(shot.frames), result.snakes, shot.frames.shape[2])
    assert not identity[:2].any()
    assert np.array_equal(np.isfinite(y), identity > 0)
    assert np.array_equal(np.isfinite(value), identity > 0)
    assert np.all((identity == 0) | (identity == np.arange(1, result.snakes + 1)[:, None]))
    assert np.all(np.isnan(result.unrotation_deg) == ~shot.timeline.lit)
    bright = value[identity > 0]
    assert 60 < np.median(bright) < 120  # 45 · (0.15 + 1.85) + 5, albedo 1


def test_first_positions_are_those_of_the_stripes() -> None:
    what = scene("flat")
    result = track(film(what).frames, film(what).timeline, PARAMS)
    seen = result.first_positions_px[: result.stripes_seen]
    assert np.isnan(result.first_positions_px[result.stripes_seen :]).all()
    true_pitch = 240 / 1.6 * 2 / what.stripes
    assert result.pitch_px == pytest.approx(true_pitch, rel=0.02)
    centre = (180 - 1) / 2 + 0.5 + 0.03 / 1.6 * 240  # canvas row of u = u0, where the phase is 0
    turns = (seen - centre) / true_pitch
    assert np.abs(turns - np.rint(turns)).max() < 0.05
    assert np.array_equal(np.diff(np.rint(turns)), np.ones(seen.size - 1))


def test_a_capture_without_stripes_is_a_problem_of_the_capture() -> None:
    shot = film(scene("flat"), level=0.0)
    with pytest.raises(CaptureProblem) as problem:
        list(track(shot.frames, shot.timeline, PARAMS).blocks)
    assert (problem.value.rule, problem.value.metric) == ("tracking", "snakes")


def test_stripes_that_vanish_during_the_rotation_are_a_problem_of_the_capture() -> None:
    shot = film(scene("flat"))
    frames = shot.frames.copy()
    frames[20 : shot.timeline.moving[1][0]] = frames[20].mean().astype(np.uint8)
    with pytest.raises(CaptureProblem, match="lost"):
        list(track(frames, shot.timeline, PARAMS).blocks)


def test_timeline_of_intervals() -> None:
    intervals = [
        {"stage": "dark", "first": 0, "last": 1},
        {"stage": "hold", "first": 2, "last": 4},
        {"stage": "rotation", "first": 5, "last": 8},
        {"stage": "hold", "first": 9, "last": 9},
        {"stage": "scan", "first": 10, "last": 11},
    ]
    timeline = snake_timeline(intervals, [None, None, *range(10)], -1)
    assert timeline.first_hold == (2, 4)
    assert timeline.second_hold == (9, 9)
    assert timeline.moving == ((5, 8), (10, 11))
    assert timeline.lit.tolist() == [False] * 2 + [True] * 10
    with pytest.raises(CaptureProblem, match="rotation"):
        snake_timeline(intervals[:2], [0.0] * 5, 1)
