"""Frames of the stages that a timeline names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Span(NamedTuple):
    """Frames of one stage, 0-based, both ends included."""

    first: int
    last: int


def stage_spans(timeline: Mapping[str, Any], stage: str) -> list[Span]:
    """Every run of a stage in timeline.json's content, in order."""
    return [Span(int(run["first"]), int(run["last"])) for run in timeline["intervals"] if run["stage"] == stage]


def stage_frames(timeline: Mapping[str, Any], stage: str) -> Span | None:
    """The longest run of a stage; ``None`` if the timeline has none."""
    return max(stage_spans(timeline, stage), key=lambda run: run.last - run.first, default=None)
