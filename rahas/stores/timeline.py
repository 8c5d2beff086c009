"""timeline.json, read by those who only need its intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Intervals:
    """The intervals of a timeline by name."""

    def __init__(self, timeline: Mapping[str, Any]) -> None:
        """``timeline`` is the content of timeline.json."""
        self._intervals: list[dict[str, Any]] = list(timeline["intervals"])
        self._frame_rate = float(timeline.get("frame_rate") or 30.0)

    def only(self, stage: str) -> dict[str, Any]:
        """The one interval of a stage that a capture has once: rotation or scan."""
        return next(i for i in self._intervals if i["stage"] == stage)

    @property
    def rotation(self) -> dict[str, Any]:
        return self.only("rotation")

    @property
    def scan(self) -> dict[str, Any]:
        return self.only("scan")

    @property
    def held_frames(self) -> range:
        """Frames with the crank surely at its stop, up to a third of a second: the reference slide position.

        The last eighth of a second before the scan is left out: within 0.05 rad the crank may be moving already.
        """
        start = int(self.scan["first"])
        hold = max((i for i in self._intervals if i["last"] < start), key=lambda i: i["last"], default=None)
        earliest = int(hold["first"]) if hold is not None and hold["stage"] == "hold" else start
        end = max(earliest + 1, start - max(1, round(self._frame_rate / 8)))
        return range(max(earliest, end - max(4, round(self._frame_rate / 4))), end)
