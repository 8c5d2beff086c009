"""Small clips of turning and moving stripes, written with PyAV, and what can happen to the files."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import av
import numpy as np

from rahas.typing import AnyArray, ByteArray

FRAMES, HEIGHT, WIDTH = 75, 120, 160


def stripes(
    count: int = FRAMES, *, order: str = "progressive", height: int = HEIGHT, width: int = WIDTH
) -> list[ByteArray]:
    """Luma (y, x), 16 … 235: hold, quarter turn, hold, movement; interlaced: the second field half a frame later."""
    y, x = np.mgrid[:height, :width]
    noise = np.random.default_rng(1)

    def at(time: float) -> AnyArray:
        angle = np.deg2rad(np.clip((time - 10) * 3, 0, 90))
        return 128 + 80 * np.cos(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / 14 + max(0.0, time - 45) * 0.25)

    frames = []
    for n in range(count):
        frame = at(n)
        if order != "progressive":
            second = 1 if order == "top_first" else 0
            frame[second::2] = at(n + 0.5)[second::2]
        frames.append(np.clip(frame + noise.normal(0, 1.5, frame.shape), 16, 235).astype(np.uint8))
    return frames


class Recipe(NamedTuple):
    """How a clip is written."""

    name: str
    codec: str
    options: Mapping[str, str] = MappingProxyType({})
    pixels: str = "yuv420p"
    bit_rate: int = 0
    order: str = "progressive"
    times_ms: Callable[[int], int] | None = None
    audio: bool = False
    rate: Fraction = Fraction(30)
    container: Mapping[str, str] = MappingProxyType({})


def write_clip(folder: Path, recipe: Recipe, frames: Sequence[AnyArray] | None = None, *, rotation: int = 0) -> Path:
    """Write a clip; luma goes into the file untouched (10 bit: times four)."""
    frames = stripes(order=recipe.order) if frames is None else frames
    path = folder / recipe.name
    with av.open(str(path), "w", options=dict(recipe.container)) as container:
        stream: Any = container.add_stream(recipe.codec, rate=recipe.rate, options=dict(recipe.options))
        stream.height, stream.width = frames[0].shape
        stream.pix_fmt = recipe.pixels
        stream.codec_context.thread_count = 1
        if rotation:
            stream.set_display_rotation(rotation)
        if recipe.bit_rate:
            stream.bit_rate = recipe.bit_rate
        if recipe.times_ms:
            stream.codec_context.time_base = Fraction(1, 1000)
        sound = container.add_stream("mp2", rate=48000) if recipe.audio else None
        for n, luma in enumerate(frames):
            frame = video_frame(luma, recipe.pixels)
            frame.pts = recipe.times_ms(n) if recipe.times_ms else n
            if recipe.times_ms:
                frame.time_base = Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if sound is not None:
            for n in range(100):
                samples = av.AudioFrame.from_ndarray(np.zeros((1, 1152 * 2), np.int16), format="s16", layout="stereo")
                samples.sample_rate, samples.pts = 48000, 1152 * n
                container.mux(sound.encode(samples))
            container.mux(sound.encode(None))
    return path


def video_frame(luma: AnyArray, pixels: str) -> av.VideoFrame:
    deep = "10" in pixels
    frame = av.VideoFrame(luma.shape[1], luma.shape[0], pixels)
    for k, plane in enumerate(frame.planes):
        samples = np.frombuffer(plane, np.uint16 if deep else np.uint8)
        rows = samples.reshape(plane.height, -1)
        if k == 0:
            rows[:, : luma.shape[1]] = luma.astype(np.uint16) * 4 if deep else luma
        else:
            rows[:] = 512 if deep else 128
    return frame


def flip(source: Path, target: Path, *, seed: int, count: int = 40) -> Path:
    """``count`` bits of the payload turned over."""
    data, draw = bytearray(source.read_bytes()), random.Random(seed)
    for _ in range(count):
        data[draw.randrange(max(2000, len(data) // 20), len(data) * 19 // 20)] ^= 1 << draw.randrange(8)
    target.write_bytes(data)
    return target


def truncate(source: Path, target: Path, *, seed: int) -> Path:
    """The end cut off, somewhere between a third and nine tenths."""
    data = source.read_bytes()
    target.write_bytes(data[: int(len(data) * random.Random(seed).uniform(0.35, 0.9))])
    return target


def remove(source: Path, target: Path, *, seed: int) -> Path:
    """Four kilobytes missing from the middle."""
    data, draw = source.read_bytes(), random.Random(seed)
    start = draw.randrange(len(data) // 5, len(data) * 7 // 10)
    target.write_bytes(data[:start] + data[start + 4096 :])
    return target


def blank(source: Path, target: Path, *, seed: int) -> Path:
    """Two kilobytes of the middle overwritten with zeros, as a bad sector reads."""
    data, draw = bytearray(source.read_bytes()), random.Random(seed)
    start = draw.randrange(len(data) // 5, len(data) * 7 // 10)
    data[start : start + 2048] = bytes(2048)
    target.write_bytes(data)
    return target
