"""What a job is given on a cluster: enough for what was measured, not wastefully more; sizes from headers alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from rahas.stores.arrays import writing_store
from rahas.stores.capture_size import CaptureSize, size_of_capture, size_of_store
from rahas.stores.video_writer import SUFFIXES, Encoding, write_frames
from rahas.tasks.resources import NEEDS, NODE_MB, START_MIN, UNKNOWN, memory_mb, runtime_min

MEGAPIXELS_40 = 40_000_000


class Measured(NamedTuple):
    """One job, watched: see docs/CLUSTER.md for the commands."""

    job: str
    width: int
    height: int
    frames: int
    peak_mb: float
    cpu_s: float

    @property
    def size(self) -> CaptureSize:
        return CaptureSize(self.frames, self.width * self.height)


MEASURED = [
    Measured("capture", 360, 240, 180, 145, 2.5),
    Measured("capture", 720, 480, 450, 300, 6.4),
    Measured("capture", 720, 480, 1800, 259, 15.6),
    Measured("capture", 1280, 720, 180, 241, 8.6),
    Measured("capture", 1920, 1080, 180, 298, 16.7),
    Measured("phase", 360, 240, 180, 256, 4.0),
    Measured("phase", 720, 480, 450, 432, 7.2),
    Measured("phase", 720, 480, 1800, 441, 20.6),
    Measured("phase", 1280, 720, 180, 341, 11.7),
    Measured("phase", 1920, 1080, 180, 477, 19.4),
    Measured("calibrate", 360, 240, 180, 119, 1.7),
    Measured("calibrate", 720, 480, 180, 151, 1.6),
    Measured("calibrate", 1280, 720, 180, 195, 2.8),
    Measured("calibrate", 1920, 1080, 180, 267, 3.8),
    Measured("surface", 360, 240, 180, 133, 1.5),
    Measured("surface", 720, 480, 450, 234, 1.7),
    Measured("surface", 1280, 720, 180, 230, 3.6),
    Measured("surface", 1920, 1080, 180, 329, 4.5),
]


@pytest.mark.parametrize("measured", MEASURED, ids=lambda m: f"{m.job} {m.width}x{m.height}x{m.frames}")
def test_asked_for_is_enough_and_not_wasteful(measured: Measured) -> None:
    memory = memory_mb(measured.job, measured.size) - NODE_MB
    assert 1.1 * measured.peak_mb <= memory <= 2.2 * measured.peak_mb
    seconds = 60 * (runtime_min(measured.job, measured.size) - START_MIN)
    assert 60 * START_MIN + seconds >= 10 * measured.cpu_s
    assert seconds <= 60 + 10 * measured.cpu_s


@pytest.mark.parametrize("job", NEEDS)
def test_grows_with_size_and_attempt(job: str) -> None:
    small, large, long = CaptureSize(450, 720 * 480), CaptureSize(450, 1920 * 1080), CaptureSize(45000, 720 * 480)
    assert memory_mb(job, small) < memory_mb(job, large)
    assert memory_mb(job, small) == memory_mb(job, long), "memory does not grow with a capture's length"
    assert runtime_min(job, small) < runtime_min(job, long)
    assert memory_mb(job, small, 2) == 2 * memory_mb(job, small)
    assert runtime_min(job, small, 2) == 2 * runtime_min(job, small)
    assert memory_mb(job, None) == memory_mb(job, UNKNOWN)
    assert memory_mb(job, large._replace(bytes_per_sample=2)) > memory_mb(job, large)


@pytest.mark.parametrize("codec", sorted(SUFFIXES))
def test_size_from_the_header(tmp_path: Path, codec: str) -> None:
    rng = np.random.default_rng(1)
    frames = [rng.integers(16, 200, (96, 128), dtype=np.uint8) for _ in range(40)]
    path = tmp_path / f"film{SUFFIXES[codec]}"
    write_frames(path, iter(frames), Encoding(codec))
    size = size_of_capture(path, max_pixels=MEGAPIXELS_40)
    assert size is not None
    assert (size.pixels, size.bytes_per_sample) == (96 * 128, 1)
    assert 40 <= size.frames <= 42


def test_size_of_a_folder_of_stills(tmp_path: Path) -> None:
    for n in range(3):
        cv2.imwrite(str(tmp_path / f"{n}.png"), np.full((20, 30), 700, np.uint16))
    (tmp_path / "notes.txt").write_text("three pictures")
    assert size_of_capture(tmp_path, max_pixels=MEGAPIXELS_40) == CaptureSize(3, 600, 2)
    assert size_of_capture(tmp_path, max_pixels=599) is None


@pytest.mark.parametrize("content", [b"", b"no video at all", b"\0" * 5000])
def test_broken_capture_has_no_size(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(content)
    assert size_of_capture(path, max_pixels=MEGAPIXELS_40) is None
    assert size_of_capture(tmp_path / "none.mp4", max_pixels=MEGAPIXELS_40) is None
    assert size_of_capture(None, max_pixels=MEGAPIXELS_40) is None


@pytest.mark.parametrize(("dtype", "bytes_per_sample"), [(np.uint8, 1), (np.uint16, 2)])
def test_size_of_a_frame_store(tmp_path: Path, dtype: type, bytes_per_sample: int) -> None:
    path = tmp_path / "frames.zarr"
    assert size_of_store(path) is None
    with writing_store(path) as store:
        store.put("frames", ("frame", "y", "x"), np.zeros((5, 6, 7), dtype), long_name="luma", units="grey level")
    assert size_of_store(path) == CaptureSize(5, 42, bytes_per_sample)


def test_a_frame_in_megabytes() -> None:
    assert math.isclose(CaptureSize(10, 1_500_000, 2).megabytes, 3.0)
    assert math.isclose(CaptureSize(10, 1_500_000, 2).total_megapixels, 15.0)
