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


class Listing:
    """Folders of captures by the names in them; each is listed once, however many rows ask."""

    def __init__(self) -> None:
        self._folders: dict[Path, dict[str, list[Path]]] = {}

    def captures_with_stem(self, captures: Path, scan_id: str) -> list[Path]:
        """Captures directly in ``captures`` with stem ``scan_id``: folders, videos, else a single file of another kind.

        An exact stem goes before one that differs in case. More than one path means that the log has to name it.
        """
        alike = self._alike(captures, scan_id)
        for plain in (str, str.casefold):
            found = [p for p in alike if plain(scan_id) in (plain(p.stem), plain(p.name) if p.is_dir() else None)]
            likely = [p for p in found if p.is_dir() or p.suffix.lower() in VIDEO_SUFFIXES]
            others = [p for p in found if p not in likely]
            if likely or len(others) == 1:
                return likely or others
        return []

    def texture_with_stem(self, folder: Path, scan_id: str) -> Path | None:
        """``<scan_id>_texture.*`` in ``folder``; of several kinds of picture the one that loses least."""
        stem = f"{scan_id}_texture"
        pictures = [p for p in self._alike(folder, stem) if p.suffix.lower() in PICTURE_SUFFIXES]
        found = [p for p in pictures if p.stem.casefold() == stem.casefold()]
        return min(found, key=lambda p: (PICTURE_SUFFIXES.index(p.suffix.lower()), p.name), default=None)

    def _alike(self, folder: Path, name: str) -> list[Path]:
        """What lies in ``folder`` with that name or stem, whatever the case, in the order of names."""
        if folder not in self._folders:
            self._folders[folder] = _by_name(folder)
        return self._folders[folder].get(name.casefold(), [])


def _by_name(folder: Path) -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    if folder.is_dir():
        for path in sorted((p for p in folder.iterdir() if not p.name.startswith(".")), key=lambda p: p.name):
            for name in {path.name.casefold(), path.stem.casefold()}:
                found.setdefault(name, []).append(path)
    return found
