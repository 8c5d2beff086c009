"""Reading video: luma to the bit, presentation times, and a reason for everything that is no video."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.params import IngestParams
from rahas.stores.capture import CaptureFacts, open_capture
from rahas.typing import AnyArray
from tests.stores.clips import FRAMES, Recipe, stripes, write_clip

PARAMS = IngestParams(max_megapixels=1.0)
FFV1 = Recipe("clip.mkv", "ffv1", {"level": "3", "slices": "4"})


def read(path: Path) -> tuple[list[AnyArray], CaptureFacts]:
    capture = open_capture(path, PARAMS)
    frames = [frame.copy() for frame in capture.frames()]
    return frames, capture.facts()


def problem(path: Path) -> CaptureProblem:
    with pytest.raises(CaptureProblem) as caught:
        read(path)
    assert caught.value.rule == "unreadable"
    assert path.name in caught.value.message
    return caught.value


@pytest.mark.parametrize(
    ("pixels", "codec", "name"),
    [
        ("yuv420p", "ffv1", "a.mkv"),
        ("yuv444p", "ffv1", "a.mkv"),
        ("yuv420p10le", "ffv1", "a.mkv"),
        ("gray", "ffv1", "a.mkv"),
        ("yuv420p", "rawvideo", "a.avi"),
        ("yuvj420p", "libx264", "a.mkv"),
    ],
)
def test_luma_comes_back_to_the_bit(tmp_path: Path, pixels: str, codec: str, name: str) -> None:
    """Whole range 0 … 255 in a stream of any range: nothing stretched or clipped; a width that pads the lines."""
    rng = np.random.default_rng(3)
    sent = [rng.integers(0, 256, (50, 70), dtype=np.uint8) for _ in range(12)]
    frames, facts = read(
        write_clip(tmp_path, Recipe(name, codec, {"qp": "0"} if codec == "libx264" else {}, pixels), sent)
    )
    deep = 4 if "10" in pixels else 1
    assert facts.bit_depth == (10 if deep == 4 else 8)
    assert len(frames) == 12
    for got, expected in zip(frames, sent, strict=True):
        np.testing.assert_array_equal(got, expected.astype(np.uint16) * deep)


def test_packed_and_colour_only_formats(tmp_path: Path) -> None:
    luma = stripes(3)[2]
    packed = np.zeros((*luma.shape, 2), np.uint8)
    packed[..., 0], packed[..., 1] = luma, 128
    for pixels, picture in (("yuyv422", packed), ("bgr24", np.repeat(luma[..., None], 3, axis=2))):
        path = tmp_path / f"{pixels}.avi"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("rawvideo", rate=30)
            stream.width, stream.height, stream.pix_fmt = luma.shape[1], luma.shape[0], pixels
            frame = av.VideoFrame(luma.shape[1], luma.shape[0], pixels)
            frame.planes[0].update(np.ascontiguousarray(picture).tobytes())
            frame.pts = 0
            container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        frames, _ = read(path)
        assert np.abs(frames[0].astype(int) - luma).max() <= 1, pixels


def test_times_start_at_zero_and_keep_their_unevenness(tmp_path: Path) -> None:
    _, mpeg = read(write_clip(tmp_path, Recipe("late.mpg", "mpeg2video", bit_rate=2_000_000)))
    np.testing.assert_allclose(mpeg.time_s, np.arange(FRAMES) / 30, atol=2e-5)
    times = [round(33.4 * n) + (n * 7) % 4 for n in range(FRAMES)]
    _, phone = read(write_clip(tmp_path, Recipe("phone.mp4", "libx264", times_ms=lambda n: times[n])))
    np.testing.assert_allclose(phone.time_s, np.array(times) / 1000, atol=1e-4)
    assert phone.frame_rate == pytest.approx(1000 / 33.4, rel=0.03)


def test_b_frames_come_in_the_order_of_presentation(tmp_path: Path) -> None:
    sent = [np.full((48, 64), 16 + 2 * n, np.uint8) for n in range(60)]
    frames, _ = read(write_clip(tmp_path, Recipe("b.mp4", "libx264", {"bf": "3", "crf": "5"}), sent))
    levels = [float(frame.mean()) for frame in frames]
    np.testing.assert_allclose(levels, [16 + 2 * n for n in range(60)], atol=1)


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_turned_phone_gives_upright_pictures(tmp_path: Path, degrees: int) -> None:
    sent = stripes(4)
    plain, _ = read(write_clip(tmp_path, Recipe("plain.mp4", "libx264", {"qp": "0"}), sent))
    path = write_clip(tmp_path, Recipe("turned.mp4", "libx264", {"qp": "0"}), sent, rotation=degrees)
    with av.open(str(path)) as container:
        shown = next(container.decode(video=0)).rotation
    frames, _ = read(path)
    np.testing.assert_array_equal(frames[2], np.rot90(plain[2], round(shown / 90)))
    assert frames[2].shape == ((160, 120) if degrees != 180 else (120, 160))


def test_missing_and_empty(tmp_path: Path) -> None:
    (tmp_path / "captures").mkdir()
    gone = problem(tmp_path / "captures" / "gone.mp4")
    assert (gone.metric, "captures/gone.mp4" in gone.message) == ("missing", True)
    (tmp_path / "empty.mp4").touch()
    assert problem(tmp_path / "empty.mp4").metric == "empty"
    (tmp_path / "dangling.mp4").symlink_to(tmp_path / "nowhere.mp4")
    assert problem(tmp_path / "dangling.mp4").metric == "missing"


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".mkv", ".mpg", ".txt", ".dv", ".mjpeg", ".h264"])
@pytest.mark.parametrize("text", ["Rain all day, lamp failed at 3.\n" * 300, "x", "1\n00:00:01 --> 00:00:02\nHola\n"])
def test_text_posing_as_video(tmp_path: Path, suffix: str, text: str) -> None:
    path = tmp_path / f"posing{suffix}"
    path.write_text(text)
    assert "it holds text" in problem(path).message or "Not one frame" in problem(path).message


def test_lists_of_files_are_not_followed(tmp_path: Path) -> None:
    """Playlists name files anywhere; such a text is refused, whatever it is called."""
    outside = write_clip(tmp_path, Recipe("outside.mp4", "libx264"))
    texts = {
        "concat.mp4": f"ffconcat version 1.0\nfile {outside.name}\n",
        "list.m3u8": f"#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\n{outside.name}\n#EXT-X-ENDLIST\n",
        "dash.mpd": f'<?xml version="1.0"?><MPD><Period><BaseURL>{outside.name}</BaseURL></Period></MPD>',
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        assert "it holds text" in problem(tmp_path / name).message


def test_other_files_posing_as_video(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    (tmp_path / "noise.mkv").write_bytes(rng.bytes(50_000))
    problem(tmp_path / "noise.mkv")
    clip = write_clip(tmp_path, Recipe("whole.mp4", "libx264")).read_bytes()
    (tmp_path / "cut.mp4").write_bytes(clip[: len(clip) // 2])
    assert "cut short" in problem(tmp_path / "cut.mp4").message
    with av.open(str(tmp_path / "sound.mkv"), "w") as container:
        stream = container.add_stream("mp2", rate=48000)
        samples = av.AudioFrame.from_ndarray(np.zeros((1, 1152 * 2), np.int16), format="s16", layout="stereo")
        samples.sample_rate = 48000
        container.mux(stream.encode(samples))
        container.mux(stream.encode(None))
    assert "audio" in problem(tmp_path / "sound.mkv").message


def test_a_header_of_256_megapixels_is_refused(tmp_path: Path) -> None:
    """The size in the header of a small MJPEG film becomes 16,000 x 16,000: the decoder must not even try."""
    data = bytearray(write_clip(tmp_path, Recipe("small.avi", "mjpeg", pixels="yuvj420p")).read_bytes())
    at = data.find(b"\xff\xc0")
    while at >= 0:
        data[at + 5 : at + 9] = (16000).to_bytes(2, "big") * 2
        at = data.find(b"\xff\xc0", at + 9)
    (tmp_path / "giant.avi").write_bytes(data)
    assert problem(tmp_path / "giant.avi").metric in ("frames", "frame_size")
    assert _megabytes_to_refuse(tmp_path / "giant.avi") < 200


@pytest.mark.parametrize(
    ("name", "codec", "options"),
    [
        ("large.mp4", "libx264", {"preset": "ultrafast", "x264-params": "bframes=0:rc-lookahead=0:ref=1"}),
        ("large.mkv", "ffv1", {"level": "3", "slices": "16"}),
        ("large.avi", "mjpeg", {}),
    ],
)
def test_frames_above_the_limit_are_refused_before_they_are_decoded(
    tmp_path: Path, name: str, codec: str, options: dict[str, str]
) -> None:
    pixels = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    path = write_clip(tmp_path, Recipe(name, codec, options, pixels), [np.full((3000, 3000), 128, np.uint8)])
    found = problem(path)
    assert found.metric == "frame_size"
    assert "3000" in found.message
    assert _megabytes_to_refuse(path) < 200


def _megabytes_to_refuse(path: Path) -> int:
    code = (
        "import sys; from pathlib import Path; from rahas.stores.video import Video\n"
        "try: list(Video(Path(sys.argv[1]), max_pixels=1_000_000).frames())\n"
        "except Exception as e: print(type(e).__name__, *(l for l in open('/proc/self/status') if 'VmHWM' in l))"
    )
    command = [sys.executable, "-c", code, str(path)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert said[0] == "CaptureProblem"
    return int(said[2]) // 1024


def test_the_longest_of_several_video_streams_counts(tmp_path: Path) -> None:
    path = tmp_path / "two.mp4"
    with av.open(str(path), "w") as container:
        streams = [container.add_stream("mpeg4", rate=30) for _ in range(2)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for stream, count, level in zip(streams, (5, 20), (60, 180), strict=True):
            for n in range(count):
                frame = av.VideoFrame(64, 48, "yuv420p")
                for plane in frame.planes:
                    plane.update(bytes([level if plane.width == 64 else 128]) * plane.buffer_size)
                frame.pts = n
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
    frames, facts = read(path)
    assert len(frames) == 20
    assert float(frames[-1].mean()) == pytest.approx(180, abs=3)
    assert facts.damage == []


def test_facts_before_the_frames_are_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="frames have to be read"):
        open_capture(write_clip(tmp_path, FFV1, stripes(3)), PARAMS).facts()
