"""Repeated and lost frames of smooth motions."""

from __future__ import annotations

import numpy as np

from rahas.kernels.dropped_frames import gaps_in_time, identical_frames, lost_frames, repeated_frames

COURSE = 60 * (lambda way: way - np.sin(2 * np.pi * way) / (2 * np.pi))(np.clip(np.arange(160) / 159, 0, 1))


def change_of(travel: np.ndarray, *, noise: float = 0.4) -> np.ndarray:
    moved = np.abs(np.diff(travel, prepend=travel[0])) * 10
    return np.sqrt(moved**2 + 2 * noise**2)


def test_repeats_are_found_and_cost_no_lost_frame() -> None:
    shows = np.arange(160)
    for n in (50, 90, 91):
        shows[n] = shows[n - 1]
    travel = COURSE[shows]
    change = change_of(travel)
    change[[50, 90, 91]] = 0.1  # what a codec leaves
    assert repeated_frames(change, travel, noise=0.4) == [50, 90, 91]
    assert lost_frames(travel, np.arange(160) / 30, noise=0.005, repeated=[50, 90, 91]) == []


def test_a_stall_and_a_turn_back_are_no_repeats() -> None:
    travel = COURSE.copy()
    travel[80:] -= np.linspace(0, 25, 80)  # goes back for a while
    stalled = np.concatenate([COURSE[:80], np.full(12, COURSE[80]), COURSE[80:]])
    for course in (travel, stalled):
        assert repeated_frames(change_of(course), course, noise=0.4) == []


def test_flicker_is_no_repeat() -> None:
    change = change_of(COURSE) + 60 * np.abs(np.sin(np.arange(160) * 1.3)) ** 3
    assert repeated_frames(change, COURSE, noise=0.4) == []


def test_lost_frames_with_and_without_a_gap_in_time() -> None:
    kept = np.setdiff1d(np.arange(160), [60, 100, 101])
    even, stamped = np.arange(len(kept)) / 30, kept / 30
    found = lost_frames(COURSE[kept], even, noise=0.005, repeated=[])
    assert [(gap.after, gap.count) for gap in found] == [(59, 1), (98, 2)]
    assert gaps_in_time(even) == []
    assert [(gap.after, gap.count) for gap in gaps_in_time(stamped)] == [(59, 1), (98, 2)]
    assert lost_frames(COURSE[kept], stamped, noise=0.005, repeated=[]) == []


def test_identical_frames_only_where_frames_have_noise() -> None:
    assert identical_frames(np.array([5.0, 1.0, 0.0, 1.1, 0.9, 1.0])) == [2]
    assert identical_frames(np.array([5.0, 0.0, 0.0, 0.0, 0.2, 0.0])) == []
