"""The films that are measured: one scene rendered once, stored by three codecs; the same, filmed four times as long."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from rahas.simulate.capture import photo, stage
from rahas.simulate.examples import example
from rahas.simulate.roof import DIAMETER_MM, target_marks
from rahas.simulate.specs import HandSpec
from rahas.stores.video_writer import SUFFIXES, Encoding, write_frames

TIMES = [name for name in HandSpec.model_fields if name.endswith("_s")]


class Film(NamedTuple):
    """One capture of the bench."""

    scan_id: str
    title: str
    codec: str
    slowness: float = 1.0
    """The hand takes so many times as long for everything."""

    @property
    def file(self) -> str:
        return self.scan_id + SUFFIXES[self.codec]


CALIBRATION = Film("target", "calibration", "ffv1")
SHORT = (Film("ffv1", "FFV1", "ffv1"), Film("h264", "H.264", "h264"), Film("mpeg2", "MPEG-2", "mpeg2"))
LONG = Film("long", "H.264, 60 s", "h264", slowness=4.0)


def make_captures(root: Path, films: Sequence[Film], say: Callable[[str], None]) -> None:
    """Render what is not there yet: videos and texture photos in captures/, and the target's table."""
    captures = root / "captures"
    write_target(root)
    for kind, slowness in (("roof", 1.0), ("circle", 1.0), ("circle", 4.0)):
        wanted = [CALIBRATION] if kind == "roof" else [film for film in films if film.slowness == slowness]
        missing = [film for film in wanted if not (captures / film.file).exists()]
        if missing:
            say(f"rendering {', '.join(film.title for film in missing)}")
            _render(captures, kind, slowness, missing)


def write_target(root: Path) -> None:
    """The renderer's roof target as config/target.csv."""
    (root / "config").mkdir(parents=True, exist_ok=True)
    rows = [[n + 1, *(f"{v:.4f}" for v in mark), DIAMETER_MM] for n, mark in enumerate(target_marks())]
    _write_table(root / "config" / "target.csv", ["mark", "x_mm", "y_mm", "z_mm", "diameter_mm"], rows)


def _render(captures: Path, kind: Any, slowness: float, films: Sequence[Film]) -> None:
    hand = {name: HandSpec.model_fields[name].default * slowness for name in TIMES}
    staged = stage(example(kind, seed=5, hand=hand))
    frames = list(staged.frames()) if len(films) > 1 else staged.frames()
    captures.mkdir(exist_ok=True)
    for film in films:
        texture = captures / f"{film.scan_id}_texture.png"
        if film is films[0]:
            cv2.imwrite(str(texture), photo(staged)[..., ::-1])
        else:
            shutil.copyfile(captures / f"{films[0].scan_id}_texture.png", texture)
        write_frames(captures / film.file, frames, Encoding(film.codec))


def write_log(root: Path, films: Sequence[Film]) -> None:
    """A field log of these films alone."""
    rows = [
        [film.scan_id, "bench", "", "keep", "calibration" if film is CALIBRATION else "scan", film.file]
        for film in films
    ]
    _write_table(root / "field_log.csv", ["scan_id", "site", "notes", "decision", "role", "capture"], rows)


def _write_table(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as handle:
        csv.writer(handle).writerows([header, *rows])
