"""Frames written by the video writer, read back with the decoder."""

from __future__ import annotations

import av
import cv2
import numpy as np
import pytest

from rahas.stores.video_writer import SUFFIXES, Encoding, write_frames

TOP_FIRST, BOTTOM_FIRST = 2, 3  # AVFieldOrder


def film(count: int = 10) -> np.ndarray:
    y, x = np.mgrid[:96, :128]
    noise = np.random.default_rng(0).normal(0, 2, (count, 96, 128))
    waves = [120 + 60 * np.cos(0.3 * y + 0.05 * x + 0.2 * n) for n in range(count)]
    return np.clip(np.array(waves) + noise, 16, 235).astype(np.uint8)


def read_back(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames, flags = [], []
        for frame in container.decode(video=0):
            plane = frame.planes[0]
            frames.append(np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[:96, :128].copy())
            flags.append(frame.interlaced_frame)
        return np.array(frames), set(flags), stream.codec_context.field_order, float(stream.average_rate)


@pytest.mark.parametrize(("codec", "worst"), [("ffv1", 0.0), ("h264", 2.0), ("mpeg2", 2.5), ("mjpeg", 2.0)])
def test_luma_comes_back(tmp_path, codec, worst):
    path = tmp_path / f"film{SUFFIXES[codec]}"
    assert write_frames(path, iter(film()), Encoding(codec, frame_rate=25.0, crf=10.0)) == 10
    frames, flags, _, rate = read_back(path)
    assert frames.shape == (10, 96, 128)
    assert flags == {False}
    assert rate == 25.0
    error = np.abs(frames.astype(float) - film()).mean()
    assert error == 0 if codec == "ffv1" else 0.1 < error < worst


@pytest.mark.parametrize("codec", ["mpeg2", "h264"])
@pytest.mark.parametrize(("fields", "order"), [("top_first", TOP_FIRST), ("bottom_first", BOTTOM_FIRST)])
def test_fields_are_flagged_as_such(tmp_path, codec, fields, order):
    path = tmp_path / f"film{SUFFIXES[codec]}"
    write_frames(path, film(), Encoding(codec, fields=fields))
    frames, flags, field_order, _ = read_back(path)
    assert len(frames) == 10
    assert flags == {True}
    assert field_order == order
    assert np.abs(frames.astype(float) - film()).mean() < 2.5


def test_lossless_fields_come_back_whole(tmp_path):
    path = tmp_path / "film.mkv"
    write_frames(path, film(), Encoding("ffv1", fields="top_first"))
    np.testing.assert_array_equal(read_back(path)[0], film())


@pytest.mark.parametrize("codec", ["ffv1", "h264", "mpeg2", "mjpeg"])
def test_equal_frames_give_equal_bytes(tmp_path, codec):
    paths = [tmp_path / name / f"film{SUFFIXES[codec]}" for name in ("a", "b")]
    for path in paths:
        write_frames(path, film(), Encoding(codec))
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_folder_of_pictures(tmp_path):
    write_frames(tmp_path / "stills", film(3), Encoding("png"))
    names = sorted(p.name for p in (tmp_path / "stills").iterdir())
    assert names == ["frame_00000.png", "frame_00001.png", "frame_00002.png"]
    assert np.array_equal(cv2.imread(str(tmp_path / "stills" / names[2]), cv2.IMREAD_UNCHANGED), film(3)[2])


def test_a_failure_midway_leaves_nothing(tmp_path):
    def broken():
        yield film()[0]
        raise RuntimeError("the hand slipped")

    with pytest.raises(RuntimeError, match="slipped"):
        write_frames(tmp_path / "film.mkv", broken(), Encoding("ffv1"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("frames", "encoding", "message"),
    [
        ([], Encoding("ffv1"), "no frames"),
        ([np.zeros((95, 128), np.uint8)], Encoding("ffv1"), "even"),
        ([np.zeros((96, 128), np.uint8)], Encoding("mjpeg", fields="top_first"), "mjpeg cannot"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, frames, encoding, message):
    with pytest.raises(ValueError, match=message):
        write_frames(tmp_path / "film.mkv", frames, encoding)
