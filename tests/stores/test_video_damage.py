"""Damaged video: nothing missed, no false alarm, and the frames concerned are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.stores.capture import CaptureFacts
from rahas.stores.container_ends import missing_bytes
from rahas.stores.video import Video
from rahas.typing import AnyArray
from tests.stores.clips import FRAMES, Recipe, blank, flip, remove, truncate, write_clip

MAX_PIXELS = 1_000_000


def uneven(n: int) -> int:
    """A phone's clock, which drops a frame now and then."""
    return round(1000 * (n + n // 20) / 30) + (n * 7919) % 5


CLEAN = [
    Recipe("h264.mp4", "libx264", {"crf": "18"}),
    Recipe("h264_short_gop.mkv", "libx264", {"crf": "18", "g": "15", "bf": "3"}),
    Recipe("h264.mts", "libx264", {"crf": "18", "g": "30"}),
    Recipe(
        "h264_interlaced.mkv",
        "libx264",
        {"crf": "18", "flags": "+ildct+ilme", "x264-params": "tff=1"},
        order="top_first",
    ),
    Recipe("h264_audio.mp4", "libx264", {"crf": "18"}, audio=True),
    Recipe("h264_faststart.mp4", "libx264", {"crf": "18"}, container={"movflags": "+faststart"}),
    Recipe("phone.mp4", "libx264", {"crf": "20"}, times_ms=uneven),
    Recipe("phone.mkv", "libx264", {"crf": "20"}, times_ms=uneven),
    Recipe("mpeg2.mpg", "mpeg2video", bit_rate=2_000_000),
    Recipe(
        "mpeg2_interlaced.mpg", "mpeg2video", {"flags": "+ilme+ildct", "bf": "2"}, bit_rate=2_000_000, order="top_first"
    ),
    Recipe("mpeg2_audio.mpg", "mpeg2video", bit_rate=2_000_000, audio=True),
    Recipe("mpeg4.avi", "mpeg4", bit_rate=2_000_000),
    Recipe("mpeg4_b_frames.avi", "mpeg4", {"bf": "2"}, bit_rate=2_000_000),
    Recipe("mjpeg.avi", "mjpeg", {"qmin": "2", "qmax": "3"}, "yuvj420p"),
    Recipe("mjpeg.mkv", "mjpeg", {"qmin": "2", "qmax": "3"}, "yuvj420p"),
    Recipe("ffv1.mkv", "ffv1", {"level": "3", "slices": "4", "slicecrc": "1"}),
    Recipe("ffv1_10bit.mkv", "ffv1", {"level": "3", "slices": "4"}, "yuv420p10le"),
    Recipe("ffv1_no_crc.mkv", "ffv1", {"level": "1"}),
    Recipe("hevc.mp4", "libx265", {"crf": "18", "x265-params": "log-level=none"}),
    Recipe("prores.mov", "prores_ks", {}, "yuv422p10le"),
    Recipe("raw.avi", "rawvideo"),
]
FLIPS_SHOW = ["h264.mp4", "h264_short_gop.mkv", "h264.mts", "h264_interlaced.mkv", "mpeg2.mpg", "mpeg2_interlaced.mpg"]
FLIPS_SHOW += ["mpeg4.avi", "mjpeg.avi", "mjpeg.mkv", "ffv1.mkv", "ffv1_10bit.mkv", "ffv1_no_crc.mkv", "prores.mov"]


@pytest.fixture(scope="session")
def clean(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("clips")
    return {recipe.name: write_clip(folder, recipe) for recipe in CLEAN}


def read(path: Path) -> tuple[list[AnyArray], CaptureFacts]:
    video = Video(path, max_pixels=MAX_PIXELS)
    frames = [frame.copy() for frame in video.frames()]
    return frames, video.facts()


@pytest.mark.parametrize("recipe", CLEAN, ids=lambda recipe: recipe.name)
def test_no_false_alarm(clean: dict[str, Path], recipe: Recipe) -> None:
    frames, facts = read(clean[recipe.name])
    assert facts.damage == []
    assert len(frames) == len(facts.time_s) == FRAMES
    assert facts.time_s[0] == 0
    assert np.all(np.diff(facts.time_s) > 0)
    assert missing_bytes(clean[recipe.name]) == 0


@pytest.mark.parametrize("name", FLIPS_SHOW)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_flipped_bits_are_noticed(clean: dict[str, Path], tmp_path: Path, name: str, seed: int) -> None:
    assert _damage_or_refusal(flip(clean[name], tmp_path / name, seed=seed))


@pytest.mark.parametrize("name", ["h264_short_gop.mkv", "mjpeg.mkv", "ffv1.mkv", "ffv1_no_crc.mkv"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_single_flipped_bit_is_noticed_where_there_are_checksums(
    clean: dict[str, Path], tmp_path: Path, name: str, seed: int
) -> None:
    path = flip(clean[name], tmp_path / name, seed=seed, count=1)
    expected, _ = read(clean[name])
    frames, facts = read(path)
    assert facts.damage
    if len(frames) == len(expected):
        broken = {n for n, (a, b) in enumerate(zip(frames, expected, strict=True)) if not np.array_equal(a, b)}
        assert broken <= _named(facts.damage), "every frame that differs is named"
        assert len(_named(facts.damage)) < FRAMES, "and not simply all of them"


@pytest.mark.parametrize("spoil", [truncate, remove, blank], ids=lambda spoil: spoil.__name__)
@pytest.mark.parametrize(
    "name", [recipe.name for recipe in CLEAN if recipe.name not in ("raw.avi", "prores.mov") and not recipe.audio]
)
def test_lost_parts_are_noticed(clean: dict[str, Path], tmp_path: Path, name: str, spoil: Any) -> None:
    assert _damage_or_refusal(spoil(clean[name], tmp_path / name, seed=5))


@pytest.mark.parametrize(
    "name", ["h264_short_gop.mkv", "mpeg2.mpg", "mjpeg.avi", "ffv1.mkv", "h264.mts", "h264_faststart.mp4"]
)
def test_a_cut_file_is_stored_as_far_as_it_goes(clean: dict[str, Path], tmp_path: Path, name: str) -> None:
    frames, facts = read(truncate(clean[name], tmp_path / name, seed=3))
    expected, _ = read(clean[name])
    assert FRAMES // 4 < len(frames) < FRAMES
    whole = min(_named(facts.damage))
    assert whole > len(frames) - 25, "only frames near the end are blamed"
    assert all(np.array_equal(a, b) for a, b in zip(frames[:whole], expected, strict=False))


def test_the_place_of_the_damage_is_told(clean: dict[str, Path], tmp_path: Path) -> None:
    data = bytearray(clean["ffv1.mkv"].read_bytes())
    with av.open(str(clean["ffv1.mkv"])) as container:
        positions = [packet.pos for packet in container.demux(video=0) if packet.size]
    data[positions[41] + 4000] ^= 8
    (tmp_path / "one.mkv").write_bytes(data)
    frames, facts = read(tmp_path / "one.mkv")
    assert len(frames) == FRAMES
    (entry,) = facts.damage
    assert (entry["kind"], entry["frame"]) == ("decoder_message", 41)
    assert 41 <= entry["last_frame"] <= 52, "up to the next key frame"
    assert "CRC" in entry["message"]


def test_lost_packets_in_even_times_are_damage_but_a_dropped_frame_is_not(tmp_path: Path) -> None:
    for lost, kinds in ((1, []), (6, ["time_gap"])):
        recipe = Recipe(
            f"lost{lost}.mkv", "ffv1", times_ms=lambda n, lost=lost: round(1000 * (n + lost * (n > 40)) / 30)
        )  # type: ignore[misc]
        _, facts = read(write_clip(tmp_path, recipe))
        assert [entry["kind"] for entry in facts.damage] == kinds
        assert [(entry["frame"], entry["last_frame"]) for entry in facts.damage] == [(40, 41)] * len(kinds)


def _named(damage: list[dict[str, Any]]) -> set[int]:
    return {n for entry in damage if entry["frame"] is not None for n in range(entry["frame"], entry["last_frame"] + 1)}


def _damage_or_refusal(path: Path) -> bool:
    try:
        frames, facts = read(path)
    except CaptureProblem as problem:
        return problem.rule == "unreadable"
    for entry in facts.damage:
        assert set(entry) == {"kind", "frame", "last_frame", "message"}
        assert entry["frame"] is None or 0 <= entry["frame"] <= entry["last_frame"] <= len(frames)
    return bool(facts.damage)
