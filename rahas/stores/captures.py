"""Which files of captures/ a row of the field log means; nothing here opens one, and no path leaves the folder."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

CAPTURES = "captures"
SIMULATED = "simulated"
VIDEO_SUFFIXES = (
    *(".mkv", ".mp4", ".m4v", ".mov", ".avi", ".mpg", ".mpeg", ".m2v", ".vob", ".mts", ".m2ts", ".ts", ".dv", ".wmv"),
    *(".webm", ".3gp", ".ogv", ".mxf", ".y4m", ".nut", ".mjpeg", ".mjpg", ".h264", ".264", ".hevc", ".flv", ".asf"),
)
PICTURE_SUFFIXES = (".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp", ".webp")  # the first of them is preferred

_DRIVE = re.compile(r"[A-Za-z]:")


class PathRefused(ValueError):
    """The cell names no place below captures/; the message says what is expected."""


def path_below_captures(cell: str) -> PurePosixPath:
    """The cell of a capture or a texture as a path relative to captures/.

    A leading ``captures/`` is dropped, a backslash counts as a slash.

    Raises
    ------
    PathRefused
        An absolute path, a home or drive letter, ``..``, a control character, or no name at all.
    """
    expected = "a file or folder below captures/, such as scan1.mp4 or day2/scan1.mp4"
    if any(ord(character) < 32 or ord(character) == 127 for character in cell):
        raise PathRefused(f"{expected}, without control characters")
    slashed = cell.replace("\\", "/")
    if slashed.startswith(("/", "~")) or _DRIVE.match(slashed):
        raise PathRefused(f"{expected}: absolute paths are refused")
    parts = [part for part in slashed.split("/") if part not in ("", ".")]
    if ".." in parts:
        raise PathRefused(f"{expected}: '..' is refused")
    if parts and parts[0] == CAPTURES:
        parts = parts[1:]
    if not parts:
        raise PathRefused(expected)
    return PurePosixPath(*parts)


def captures_with_stem(captures: Path, scan_id: str) -> list[Path]:
    """Captures directly in ``captures`` whose stem is ``scan_id``: folders, videos, else a single file of another kind.

    An exact stem goes before one that differs in case. More than one path means that the log has to name it.
    """
    children = _visible(captures)
    for plain in (str, str.casefold):
        found = [p for p in children if plain(scan_id) in (plain(p.stem), plain(p.name) if p.is_dir() else None)]
        likely = [p for p in found if p.is_dir() or p.suffix.lower() in VIDEO_SUFFIXES]
        others = [p for p in found if p not in likely]
        if likely or len(others) == 1:
            return likely or others
    return []


def texture_with_stem(folder: Path, scan_id: str) -> Path | None:
    """``<scan_id>_texture.*`` in ``folder``; of several kinds of picture the one that loses least."""
    stem = f"{scan_id}_texture".casefold()
    found = [p for p in _visible(folder) if p.stem.casefold() == stem and p.suffix.lower() in PICTURE_SUFFIXES]
    return min(found, key=lambda p: (PICTURE_SUFFIXES.index(p.suffix.lower()), p.name), default=None)


def _visible(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if not p.name.startswith("."))
