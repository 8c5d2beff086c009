"""The page of a scan: from whatever artifacts there are, whole, escaped, without a network, the same every time."""

from __future__ import annotations

import hashlib
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import pytest

from rahas.stores.atomic import write_json
from rahas.stores.layout import ScanFolder
from rahas.tasks import page
from tests.report import expedition_builder as build

HOSTILE = (
    """<script>alert("x")</script> <img src=x onerror='a()'> & "quotes" 'single' {{ 7*7 }} {% raw %} ünï 洞 \u202e"""
)


class Page(HTMLParser):
    """Tags, links and text of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    @property
    def links(self) -> list[str]:
        return [str(a[key]) for _, a in self.tags for key in ("href", "src") if key in a]

    def has_word_in_heading(self, heading: str) -> bool:
        return f"<h2>{heading}" in self.source


@pytest.fixture
def scan(tmp_path: Path) -> ScanFolder:
    return build.folder(tmp_path / "results")


def written(scan: ScanFolder, **changes: Any) -> Page:
    entry = build.entry(scan.scan_id, **changes)
    calibration = None if entry.role == "calibration" else ScanFolder(scan.results, "cal1")
    page.run(scan, entry=entry, calibration=calibration)
    return Page(scan.report)


def broken_links(result: Page, scan: ScanFolder) -> list[str]:
    """Links of the page that lead nowhere; the index is written later."""
    local = [link.partition("#")[0] for link in result.links]
    return [link for link in local if not (scan.path / link).exists() and link != "../index.html"]


def test_an_accepted_scan_shows_every_part_and_every_link_resolves(scan: ScanFolder) -> None:
    build.write_all(scan)
    result = written(scan, notes="Third try, knee-deep.")
    assert broken_links(result, scan) == []
    for heading in ("The capture", "Surface", "Stripes", "Phase", "Metrics", "Files"):
        assert result.has_word_in_heading(heading), heading
    names = {path.name for path in scan.figures.iterdir()}
    expected = {"depth.png", "relief.jpg", "colour.jpg", "wrapped_phase.png", "unwrapped_phase.png", "quality.jpg"}
    expected |= {"modulation.jpg", "z_std.jpg", "thumbnail.jpg", *(f"frame_{letter}.jpg" for letter in "abcdefg")}
    expected |= {f"snakes_{part}.jpg" for part in ("first_hold", "mid_rotation", "reference_hold")}
    assert names == expected
    shown = {link.removeprefix("figures/") for link in result.links if link.startswith("figures/")}
    assert shown == names - {"thumbnail.jpg"}
    assert "Third try, knee-deep." in result.text
    assert "object span 0.93" in result.text


def test_notes_as_typed_cannot_become_markup(scan: ScanFolder) -> None:
    build.write_all(scan)
    qa = build.verdict(outcome="rejected", reasons=[build.reason(message=HOSTILE)])
    write_json(scan.qa, qa)
    result = written(scan, notes=HOSTILE, site=HOSTILE, subject=HOSTILE, operator=HOSTILE, extra={HOSTILE: HOSTILE})
    assert not any(tag == "script" for tag, _ in result.tags)
    assert not any(name.startswith("on") for _, attributes in result.tags for name in attributes)
    assert all(attributes.get("src") != "x" for _, attributes in result.tags)
    assert result.text.count('alert("x")') >= 5
    assert "{{ 7*7 }}" in result.text


def test_the_page_needs_no_network_and_no_script(scan: ScanFolder) -> None:
    build.write_all(scan)
    result = written(scan, notes="see https://example.org/x")
    outside = [link for link in result.links if ":" in link or link.startswith("//")]
    assert outside == []
    assert "url(" not in result.source
    assert "@import" not in result.source
    assert not any(tag in ("script", "link", "iframe", "object", "base") for tag, _ in result.tags)


def test_a_rejected_scan_has_its_reason_and_no_surface(scan: ScanFolder) -> None:
    build.write_capture(scan)
    write_json(scan.capture_review, {"reasons": [], "warnings": [], "metrics": {}})
    write_json(scan.qa, build.verdict(outcome="rejected", reasons=[build.reason()], gate="capture"))
    result = written(scan)
    assert "The rig shook by 3.4 px" in result.text
    assert "jitter 3.41\u202fpx, limit 1\u202fpx" in "".join(result.words)
    assert "keep" in result.text
    assert "by what the capture shows" in result.text
    assert not result.has_word_in_heading("Surface")
    assert not (scan.figures / "depth.png").exists()
    assert broken_links(result, scan) == []


def test_an_unreadable_capture_has_only_its_verdict(scan: ScanFolder) -> None:
    unreadable = build.reason(
        "unreadable", metric="decoder", value=None, limit=None, unit="", message="No video in it."
    )
    write_json(scan.qa, build.verdict(outcome="rejected", reasons=[unreadable], metrics={}))
    result = written(scan)
    assert "No video in it." in result.text
    assert not result.has_word_in_heading("The capture")
    assert list(scan.figures.iterdir()) == []
    assert broken_links(result, scan) == []


def test_the_operators_reject_stands_beside_not_processed(scan: ScanFolder) -> None:
    write_json(scan.qa, build.verdict(outcome="not_processed", decision="reject", reasons=[build.reason("operator")]))
    result = written(scan, decision="reject")
    assert "operator, in the field reject" in result.text
    assert "rules not processed" in result.text


def test_a_scan_let_through_is_marked_as_such(scan: ScanFolder) -> None:
    build.write_all(scan)
    write_json(scan.qa, build.verdict(warnings=[build.reason() | {"waived": True}], overridden=True))
    result = written(scan)
    assert "accepted, let through" in result.text
    assert "Let through: The rig shook" in result.text


def test_frames_without_a_timeline_are_shown_all_the_same(scan: ScanFolder) -> None:
    build.write_capture(scan)
    scan.timeline.unlink()
    write_json(scan.qa, build.verdict(outcome="rejected", reasons=[build.reason("timeline")]))
    result = written(scan)
    assert "No timeline was found" in result.text
    assert len(list(scan.figures.glob("frame_*.jpg"))) == 5


def test_a_calibration_shows_its_marks_and_residuals(scan: ScanFolder) -> None:
    build.write_capture(scan)
    build.write_phase(scan)
    write_json(scan.calibration, build.calibration() | {"warnings": ["The photo of the target is blurred."]})
    write_json(scan.qa, build.verdict())
    result = written(scan, role="calibration", calibration=None)
    assert (scan.figures / "marks.jpg").is_file()
    assert sum(tag == "tr" for tag, _ in result.tags) >= 18
    assert "camera residual" in result.text
    assert "−0.250" in result.text
    assert "The photo of the target is blurred." in result.text
    assert broken_links(result, scan) == []


def test_figures_are_small_whatever_the_frame(scan: ScanFolder) -> None:
    build.write_all(scan, shape=(1280, 960))
    written(scan)
    for path in scan.figures.iterdir():
        height, width = cv2.imread(str(path)).shape[:2]
        assert width <= 720, path.name
        assert height <= 1100, path.name


def test_portrait_frames_keep_their_shape(scan: ScanFolder) -> None:
    build.write_all(scan, shape=(192, 128))
    written(scan)
    height, width = cv2.imread(str(scan.figures / "relief.jpg")).shape[:2]
    assert (height, width) == (192, 128)
    assert "portrait" in scan.report.read_text(encoding="utf-8")


def test_the_same_artifacts_give_the_same_page(scan: ScanFolder) -> None:
    build.write_all(scan)
    written(scan)
    before = digests(scan)
    written(scan)
    assert digests(scan) == before


def test_a_failed_page_leaves_no_figures_behind(scan: ScanFolder) -> None:
    build.write_all(scan)
    scan.qa.unlink()
    with pytest.raises(FileNotFoundError):
        written(scan)
    assert not scan.report.exists()
    assert list(scan.path.glob(".making-*")) == []


def test_a_page_is_quick(scan: ScanFolder) -> None:
    build.write_all(scan, shape=(480, 720))
    written(scan)
    started = time.process_time()
    written(scan)
    assert time.process_time() - started < 0.8


def digests(scan: ScanFolder) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in [scan.report, *scan.figures.iterdir()]}
