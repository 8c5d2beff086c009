"""A capture whatever it is stored as: its frames in order, once, and the facts about them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from rahas.errors import CaptureProblem
from rahas.params import IngestParams
from rahas.typing import AnyArray, FloatArray


@dataclass(frozen=True)
class CaptureFacts:
    """Known when the last frame has been read."""

    time_s: FloatArray
    """presentation times from the first frame on, (frame)"""
    frame_rate: float
    codec: str
    bit_depth: int
    flagged_order: str
    """``progressive``, ``top_first`` or ``bottom_first``, as the stream says; the content may know better"""
    luma_range: str
    """``limited``, ``full`` or ``unknown``"""
    damage: list[dict[str, Any]]
    """see :func:`rahas.stores.damage.findings`"""
    declared_frames: int | None


class Capture(Protocol):
    """A capture being read: ``frames`` may be gone through once, ``facts`` asked for after that."""

    @property
    def bit_depth(self) -> int:
        """Significant bits of a sample, known from the first frame on."""

    def frames(self) -> Iterator[AnyArray]:
        """Luma (y, x) of each frame in the order of presentation, uint8 or uint16, valid until the next one."""

    def facts(self) -> CaptureFacts: ...


def open_capture(path: Path, params: IngestParams) -> Capture:
    """Open a video file or a folder of stills.

    Raises
    ------
    CaptureProblem
        (rule ``unreadable``) It is missing, empty, or neither.
    """
    max_pixels = round(params.max_megapixels * 1e6)
    if path.is_dir():
        from rahas.stores.images import ImageFolder

        return ImageFolder(path, max_pixels=max_pixels, frame_rate=params.frame_rate or 30.0)
    if not path.exists():
        raise unreadable(
            "missing",
            f"There is no capture at captures/{_below(path)}. Copy it from the camera's card, or correct the column "
            "capture of the field log.",
        )
    if path.stat().st_size == 0:
        raise unreadable("empty", f"{path.name} is empty (0 bytes). Copy it from the camera's card again.")
    from rahas.stores.video import Video

    return Video(path, max_pixels=max_pixels)


def unreadable(
    metric: str, message: str, *, value: float | str | None = None, limit: float | None = None, unit: str = ""
) -> CaptureProblem:
    """The reason of a capture that cannot be read at all."""
    return CaptureProblem("unreadable", metric, message, value=value, limit=limit, unit=unit)


def even_times(count: int, frame_rate: float) -> FloatArray:
    """Times of frames that carry none."""
    return np.arange(count, dtype=np.float64) / frame_rate


def _below(path: Path) -> str:
    parts = path.parts
    return "/".join(parts[len(parts) - parts[::-1].index("captures") :]) if "captures" in parts[:-1] else path.name
