"""Frames read by bands of rows give what whole frames give."""

from __future__ import annotations

import numpy as np
import pytest
import zarr

from rahas.stages import frame_bands
from rahas.stages.frame_bands import FieldFrames, bands_of
from rahas.stages.phase_maps import Steadied
from tests.stages.test_phase import film, solved

FRAMES = np.random.default_rng(8).integers(0, 255, (21, 60, 40)).astype(np.uint8)
FIELDS = [slice(None), slice(0, None, 2), slice(1, None, 2)]


@pytest.fixture
def small_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_bands, "WHOLE_PIXELS", 500)
    monkeypatch.setattr(frame_bands, "BAND_PIXELS", 500)


@pytest.mark.usefixtures("small_bands")
@pytest.mark.parametrize("rows", FIELDS, ids=["progressive", "top", "bottom"])
@pytest.mark.parametrize("stored", [False, True], ids=["in memory", "stored"])
def test_bands_make_the_field(rows: slice, stored: bool) -> None:
    frames = zarr.array(FRAMES, chunks=(8, 10, 40)) if stored else FRAMES
    field = FieldFrames(frames, 2, 20, rows)
    bands = field.bands()
    assert len(bands) > 1
    assert max((b.stop - b.start) * 40 for b in bands) <= 500
    assert [b.start for b in bands] == [0, *(b.stop for b in bands[:-1])]
    whole = np.concatenate([np.concatenate(list(field.blocks(b))) for b in bands], axis=1)
    np.testing.assert_array_equal(whole, FRAMES[2:20, rows])
    y, x = np.array([25, 3, 3, 14]), np.array([0, 39, 7, 20])
    np.testing.assert_array_equal(field.at(y, x), FRAMES[2:20, rows][:, y, x])


def test_small_frames_are_one_band() -> None:
    assert bands_of(np.empty((1, 480, 720), np.uint8)) == [slice(0, 480)]
    assert len(bands_of(np.empty((1, 1080, 1920), np.uint8))) >= 8


def test_a_displaced_object_is_moved_back_across_bands() -> None:
    shift = np.random.default_rng(2).normal(0, 0.8, (21, 2))
    steadied = Steadied(FieldFrames(FRAMES, 0, 21, slice(None)), shift)
    whole = np.concatenate(list(steadied.blocks(slice(0, 60))))
    parts = [np.concatenate(list(steadied.blocks(slice(a, a + 12)))) for a in range(0, 60, 12)]
    assert np.abs(np.concatenate(parts, axis=1) - whole).max() < 1e-3  # grey levels, of up to 255
    assert np.mean(whole != FRAMES) > 0.5


@pytest.mark.parametrize("interlaced", [False, True], ids=["progressive", "interlaced"])
def test_phase_does_not_depend_on_bands(interlaced: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    what = film(interlaced=interlaced)
    whole = solved(what, method="joint")
    monkeypatch.setattr(frame_bands, "WHOLE_PIXELS", 2000)
    monkeypatch.setattr(frame_bands, "BAND_PIXELS", 2000)
    banded = solved(what, method="joint")
    np.testing.assert_array_equal(banded.fringe_order, whole.fringe_order)
    np.testing.assert_allclose(banded.unwrapped_phase, whole.unwrapped_phase, atol=2e-5)
    np.testing.assert_allclose(banded.phase_std, whole.phase_std, rtol=1e-4)
