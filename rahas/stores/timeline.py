"""timeline.json, read by those who only need its intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LONGEST_CREEP_S = 3.0  # a slower hand is not waited for: every frame from the hold on is solved


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
        """Frames with the crank surely at its stop, a quarter of a second of them: the reference slide position.

        They are those in the middle of the hold before the scan: at its start the lever may still turn by tenths of a
        degree, and towards the scan, which begins when the pattern is 0.05 rad off, a slow hand's crank moves already.
        """
        start, second = int(self.scan["first"]), self._frame_rate
        hold = max((i for i in self._intervals if i["last"] < start), key=lambda i: i["last"], default=None)
        earliest = int(hold["first"]) if hold is not None and hold["stage"] == "hold" else start
        count = max(4, round(second / 4))
        first = max(earliest, (earliest + start - count) // 2, start - count - round(LONGEST_CREEP_S * second))
        end = max(earliest + 1, start - max(1, round(second / 8)))
        return range(min(first, end - 1), min(first + count, end))
