"""Ingest: figures and thumbnails of each frame, whatever the blocks, and the store that holds them."""

from __future__ import annotations

import json
import resource
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

from rahas.errors import CaptureProblem
from rahas.params import IngestParams
from rahas.stages.ingest import finish_thumbnails, join_measures, measure_block, thumbnail_scale
from rahas.stores.arrays import open_store
from rahas.stores.frames import chunk_and_shard, in_blocks
from rahas.stores.layout import ScanFolder
from rahas.tasks import ingest
from rahas.typing import AnyArray
from tests.stores.clips import FRAMES, Recipe, stripes, truncate, write_clip


def noise(count: int = 11, shape: tuple[int, int] = (22, 30), depth: int = 8, seed: int = 0) -> AnyArray:
    return (
        np.random.default_rng(seed).integers(0, 2**depth, (count, *shape)).astype(np.uint8 if depth == 8 else np.uint16)
    )


@pytest.mark.parametrize("depth", [8, 10, 12, 16])
@pytest.mark.parametrize("order", ["progressive", "top_first", "bottom_first"])
def test_thumbnails_are_block_means(depth: int, order: str) -> None:
    frames = noise(depth=depth)
    halves = measure_block(frames, None, bit_depth=depth).thumbnails
    small = finish_thumbnails(halves, order)
    rows = {"progressive": [0, 1, 2, 3], "top_first": [0, 2], "bottom_first": [1, 3]}[order]
    blocks = frames[:, :20, :28].reshape(-1, 5, 4, 7, 4)[:, :, rows].astype(float)
    assert small.dtype == np.uint16
    np.testing.assert_allclose(
        small / thumbnail_scale(depth), blocks.mean(axis=(2, 4)), atol=1.01 / thumbnail_scale(depth)
    )


def test_figures_of_each_frame() -> None:
    frames = noise()
    got = measure_block(frames[1:], frames[0], bit_depth=8)
    as_float = frames.astype(float)
    np.testing.assert_allclose(got.mean_level, as_float[1:].mean(axis=(1, 2)))
    np.testing.assert_allclose(got.change, np.abs(np.diff(as_float, axis=0)).mean(axis=(1, 2)))
    for k, level in enumerate((0, 16)):
        np.testing.assert_allclose(got.low_shares[:, k], (frames[1:] <= level).mean(axis=(1, 2)))
    for k, level in enumerate((254, 234, 240)):
        np.testing.assert_allclose(got.high_shares[:, k], (frames[1:] >= level).mean(axis=(1, 2)))


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(1, 10), max_size=4, unique=True), depth=st.sampled_from([8, 10]))
def test_the_result_does_not_depend_on_the_blocks(cuts: list[int], depth: int) -> None:
    frames = noise(depth=depth)
    whole = measure_block(frames, None, bit_depth=depth)
    edges = [0, *sorted(cuts), len(frames)]
    parts = [measure_block(frames[a:b], frames[a - 1] if a else None, bit_depth=depth) for a, b in pairwise(edges)]
    for name in whole._fields:
        joined = np.concatenate([getattr(part, name) for part in parts], axis=1 if name == "thumbnails" else 0)
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


@pytest.mark.parametrize(
    ("luma_range", "brightest", "levels"),
    [
        ("limited", 235, (16, 234)),
        ("limited", 255, (16, 254)),
        ("unknown", 235, (16, 234)),
        ("unknown", 255, (0, 254)),
        ("full", 235, (0, 254)),
    ],
)
def test_clip_levels_follow_the_range_and_superwhite(luma_range: str, brightest: int, levels: tuple[int, int]) -> None:
    frames = np.full((3, 16, 16), 100, np.uint8)
    frames[:, :4] = brightest
    measured = measure_block(frames, None, bit_depth=8)
    found = join_measures([measured], bit_depth=8, luma_range=luma_range, flagged_order="progressive")
    assert found.clip_levels == levels
    expected = 0.25 if brightest >= levels[1] else 0.0
    np.testing.assert_allclose(found.clipped_high_share, expected)


def test_the_store_is_as_the_architecture_says(tmp_path: Path) -> None:
    sent = stripes(order="bottom_first")
    path = write_clip(tmp_path, Recipe("clip.mkv", "ffv1", {"level": "3", "slices": "4"}), sent)
    scan = ScanFolder(tmp_path / "results", "clip")
    ingest.run(scan, capture=path, params=IngestParams())
    with xarray.open_zarr(scan.frames) as store:
        assert {name: store[name].dims for name in store} == {
            **{"frames": ("frame", "y", "x"), "thumbnail": ("frame", "y_thumb", "x_thumb"), "time_s": ("frame",)},
            **dict.fromkeys(("mean_level", "clipped_low_share", "clipped_high_share", "change"), ("frame",)),
        }
        np.testing.assert_array_equal(store["frames"], np.stack(sent))
        assert all(store[name].attrs["long_name"] and store[name].attrs["units"] for name in store)
        small = np.stack(sent)[:, :, :].reshape(FRAMES, 30, 4, 40, 4)[:, :, [1, 3]].mean(axis=(2, 4))
        np.testing.assert_allclose(store["thumbnail"] / 64.0, small, atol=0.02)
        attributes = dict(store.attrs)
        assert store["frames"].encoding["chunks"] == (8, 120, 160)
    assert attributes == {
        **{"frame_rate": 30.0, "codec": "ffv1", "bit_depth": 8, "interlaced": True, "field_order": "bottom_first"},
        **{"flagged_field_order": "progressive", "luma_range": "unknown", "clip_levels": [16, 234]},
        **{"damage": [], "declared_frames": None},
    }


def test_a_cut_capture_is_stored_with_its_damage(tmp_path: Path) -> None:
    whole = write_clip(tmp_path, Recipe("whole.mkv", "ffv1", {"level": "3", "slices": "4"}))
    scan = ScanFolder(tmp_path / "results", "cut")
    ingest.run(scan, capture=truncate(whole, tmp_path / "cut.mkv", seed=1), params=IngestParams())
    store = open_store(scan.frames)
    damage = store.attrs["damage"]
    json.dumps(damage)
    assert isinstance(damage, list)
    assert "truncated" in {entry["kind"] for entry in damage}  # type: ignore[index, call-overload]
    assert 20 < store["frames"].shape[0] < FRAMES
    assert store["time_s"].shape == store["mean_level"].shape == store["frames"].shape[:1]


def test_a_refused_capture_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("hello\n" * 100)
    scan = ScanFolder(tmp_path / "results", "text")
    with pytest.raises(CaptureProblem):
        ingest.run(scan, capture=tmp_path / "text.mp4", params=IngestParams())
    assert not scan.frames.exists()
    assert list(scan.path.iterdir()) == []


def test_twice_the_same_capture_gives_the_same_bytes(tmp_path: Path) -> None:
    path = write_clip(tmp_path, Recipe("clip.mp4", "libx264"))
    manifests = []
    for name in ("one", "two"):
        scan = ScanFolder(tmp_path / "results", name)
        ingest.run(scan, capture=path, params=IngestParams())
        manifests.append((scan.frames / "manifest.json").read_text())
    assert manifests[0] == manifests[1]


def test_memory_does_not_grow_with_length(tmp_path: Path) -> None:
    """Blocks of frames are let go: 600 MB of frames pass through a few tens of MB."""
    frame = np.zeros((1000, 1000), np.uint8)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    count = sum(len(block) for block in in_blocks(frame for _ in range(600)))
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert count == 600
    assert grown_mb < 150


def test_large_frames_come_in_small_blocks() -> None:
    assert chunk_and_shard((480, 720), np.dtype(np.uint8)) == (8, 64)
    chunk, shard = chunk_and_shard((2160, 3840), np.dtype(np.uint16))
    assert shard % chunk == 0
    assert shard * 2160 * 3840 * 2 <= 48 << 20
    assert chunk_and_shard((8000, 8000), np.dtype(np.uint16)) == (1, 1)
