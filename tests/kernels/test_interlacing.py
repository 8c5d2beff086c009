"""Interlacing: told from the content, whatever the flags say, and fields brought to full height."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rahas.kernels.interlacing import (
    FieldDistances,
    field_distances,
    fields,
    first_field_full_height,
    recognise_interlacing,
)
from rahas.typing import AnyArray

ORDERS = ("progressive", "top_first", "bottom_first")


def moving_stripes(
    order: str, *, step_rad: float, noise: float, still: int = 10, moving: int = 20, seed: int = 0
) -> AnyArray:
    """Stripes 24 px wide that stand, then move by ``step_rad`` a frame."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:96, :128]
    frames = np.empty((still + moving, 96, 128))
    for n in range(still + moving):
        for rows, moment in zip(fields(order != "progressive", order), (n, n + 0.5), strict=False):
            phase = 2 * np.pi * (0.3 * x[rows] + y[rows]) / 24 - max(0.0, moment - still) * step_rad
            frames[n, rows] = 120 + 70 * np.cos(phase)
    return np.clip(frames + rng.normal(0, noise, frames.shape), 0, 255).astype(np.uint8)


def recognised(frames: AnyArray, flagged: str) -> tuple[str, float | None]:
    pairs = [field_distances(frames[n - 1], frames[n]) for n in range(1, len(frames))]
    found = recognise_interlacing(FieldDistances(*np.array(pairs).T), flagged)
    assert found.interlaced == (found.field_order != "progressive")
    return found.field_order, found.lean


@pytest.mark.parametrize("flagged", ORDERS)
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("step_rad", [0.1, 0.4, 1.2, 2.0])
def test_the_content_wins_over_lying_flags(order: str, flagged: str, step_rad: float) -> None:
    found, lean = recognised(moving_stripes(order, step_rad=step_rad, noise=3.0), flagged)
    assert found == order
    assert lean == pytest.approx({"progressive": 0.0, "top_first": 1.0, "bottom_first": -1.0}[order], abs=0.2)


@pytest.mark.parametrize("flagged", ORDERS)
def test_where_nothing_moves_the_flags_count(flagged: str) -> None:
    assert recognised(moving_stripes("progressive", step_rad=0.0, noise=4.0), flagged) == (flagged, None)


@pytest.mark.parametrize("order", ORDERS)
def test_lamp_switches_and_a_jump_do_not_mislead(order: str) -> None:
    frames = moving_stripes(order, step_rad=0.3, noise=2.0)
    frames[:3] //= 20
    frames[-2:] //= 20
    frames[15:] = np.roll(frames[15:], 8, axis=2)
    assert recognised(frames, "progressive")[0] == order


def test_fields_come_in_the_order_of_time() -> None:
    rows = np.arange(8)
    assert [list(rows[s]) for s in fields(False, "progressive")] == [list(range(8))]
    assert [list(rows[s]) for s in fields(True, "top_first")] == [[0, 2, 4, 6], [1, 3, 5, 7]]
    assert [list(rows[s]) for s in fields(True, "bottom_first")] == [[1, 3, 5, 7], [0, 2, 4, 6]]


@given(
    frames=hnp.arrays(np.uint8, st.tuples(st.integers(1, 3), st.integers(4, 9), st.integers(1, 5))),
    order=st.sampled_from(["top_first", "bottom_first"]),
    as_float=st.booleans(),
)
def test_full_height_is_the_linear_interpolation_of_the_first_field(
    frames: AnyArray, order: str, as_float: bool
) -> None:
    stack = frames.astype(np.float32) if as_float else frames
    full = first_field_full_height(stack, order)
    own = np.arange(1 if order == "bottom_first" else 0, stack.shape[1], 2)
    expected = np.apply_along_axis(lambda c: np.interp(np.arange(len(c)), own, c[own]), 1, stack.astype(float))
    assert full.dtype == stack.dtype
    np.testing.assert_allclose(full, expected, atol=1e-4 if as_float else 0.5)
    np.testing.assert_array_equal(full[:, own], stack[:, own])
    np.testing.assert_array_equal(first_field_full_height(stack[0], order), full[0])


def test_progressive_frames_stay_as_they_are() -> None:
    frames = np.arange(24, dtype=np.uint16).reshape(2, 4, 3)
    assert first_field_full_height(frames, "progressive") is frames
