"""Luma comes out of every pixel format as it was put in."""

from __future__ import annotations

import av
import numpy as np
import pytest

from rahas.stores.luma import bit_depth_of, luma_of

WIDTH, HEIGHT = 64, 16


def ramp(bits: int) -> np.ndarray:
    """(y, x) codes over the whole range, no two rows alike."""
    place = np.arange(HEIGHT)[:, None] * 37 + np.arange(WIDTH) * 11
    return (place % 997 * (2**bits - 1) // 996).astype(np.uint16)


def frame_of(name: str, words: np.ndarray) -> av.VideoFrame:
    """A frame whose only plane holds ``words`` (row, word)."""
    frame = av.VideoFrame(WIDTH, HEIGHT, name)
    plane = frame.planes[0]
    rows = np.zeros((plane.buffer_size // plane.line_size, plane.line_size), np.uint8)
    packed = np.ascontiguousarray(words).view(np.uint8)
    rows[:HEIGHT, : packed.shape[1]] = packed
    plane.update(rows.tobytes())
    return frame


@pytest.mark.parametrize(("name", "bits"), [("y210le", 10), ("y212le", 12)])
def test_packed_words_hold_luma_in_their_upper_bits(name: str, bits: int) -> None:
    words = np.full((HEIGHT, 2 * WIDTH), 0x5A5A, "<u2")  # colour
    words[:, ::2] = ramp(bits) << (16 - bits)
    frame = frame_of(name, words)
    assert bit_depth_of(frame) == bits
    np.testing.assert_array_equal(luma_of(frame), ramp(bits))


def test_packed_luma_of_four_words_a_pixel() -> None:
    """xv36: U, Y, V and nothing, each in the upper 12 of 16 bits."""
    words = np.full((HEIGHT, 4 * WIDTH), 0x5A50, "<u2")
    words[:, 1::4] = ramp(12) << 4
    frame = frame_of("xv36le", words)
    np.testing.assert_array_equal(luma_of(frame), ramp(12))


def test_packed_bytes_of_four_a_pixel() -> None:
    """vuya: V, U, Y and transparency."""
    samples = np.full((HEIGHT, 4 * WIDTH), 90, np.uint8)
    samples[:, 2::4] = ramp(8)
    np.testing.assert_array_equal(luma_of(frame_of("vuya", samples)), ramp(8))
