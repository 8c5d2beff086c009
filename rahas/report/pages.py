"""Pages from templates: everything typed by people is escaped, nothing is fetched, no script is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jinja2

from rahas.report import words
from rahas.report.figures import Figure
from rahas.report.plots import LinePlot, Strip

TEMPLATES = Path(__file__).parent / "templates"


class Section(NamedTuple):
    """A part of a scan's page: heading, one sentence of introduction, figures; ``layout`` is ``strip`` or ``pair``."""

    title: str
    intro: str
    figures: list[Figure]
    layout: str = "pair"


class FileLink(NamedTuple):
    """An artifact of the scan, what it holds, and its provenance record (``None`` if there is none); relative paths."""

    path: str
    holds: str
    record: str | None


@dataclass(frozen=True)
class ScanPage:
    """What a scan's page shows. ``row`` holds the log's cells as typed, ``qa`` the verdict file."""

    row: Mapping[str, Any]
    qa: Mapping[str, Any]
    strip: Strip | None = None
    frames: list[Figure] = field(default_factory=list)
    plots: list[LinePlot] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    marks: list[dict[str, str]] = field(default_factory=list)
    facts: list[tuple[str, str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    files: list[FileLink] = field(default_factory=list)


@dataclass(frozen=True)
class Card:
    """One row of the log in the index. ``thumbnail`` and ``link`` are relative to results/, ``None`` where missing."""

    row: Mapping[str, Any]
    qa: Mapping[str, Any] | None
    thumbnail: str | None = None
    link: str | None = None

    @property
    def verdict(self) -> str:
        return words.verdict_of(self.qa)

    @property
    def line(self) -> str:
        """The reason in one line; for an accepted scan its first warning, if any."""
        if self.qa is None:
            return "No result yet: its job failed or has not run."
        findings = self.qa.get("reasons") or self.qa.get("warnings") or []
        return words.finding_line(findings[0]) if findings else ""


def render_scan(page: ScanPage) -> str:
    """HTML of a scan's page."""
    return _environment().get_template("scan.html.j2").render(page=page, row=page.row, qa=page.qa)


def render_index(cards: Sequence[Card]) -> str:
    """HTML of the expedition at a glance: counts, then the rows grouped by site in the order of the log."""
    sites: dict[str, list[Card]] = {}
    for card in cards:
        sites.setdefault(str(card.row["site"]), []).append(card)
    counts = [
        (verdict, label, sum(card.verdict == verdict for card in cards))
        for verdict, label in words.VERDICT_WORDS.items()
    ]
    dates = sorted({str(card.row["date"]) for card in cards if card.row["date"]})
    template = _environment().get_template("index.html.j2")
    return template.render(sites=sites, counts=counts, dates=dates, total=len(cards))


def template(name: str) -> jinja2.Template:
    """A template by its file's name, for a page that another module fills."""
    return _environment().get_template(name)


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["metric_label"] = words.metric_label
    environment.filters["metric_unit"] = words.metric_unit
    environment.filters["metric_meaning"] = words.metric_meaning
    environment.filters["value_text"] = words.value_text
    environment.filters["finding_line"] = words.finding_line
    environment.filters["measured_against"] = words.measured_against
    environment.globals["verdict_words"] = words.VERDICT_WORDS
    return environment
