"""The page of a comparison: self-contained, escaped, its map true to the numbers."""

from __future__ import annotations

import base64
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from rahas.cli import main
from rahas.report.colours import coloured
from rahas.report.comparison import difference_picture, signed_scale
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder
from tests.report import expedition_builder as build

HOSTILE = """<script>alert("x")</script> <img src=x onerror='a()'> {{ 7*7 }}"""


@pytest.fixture
def page(tmp_path: Path) -> str:
    """One surface lifted, and a reason that would like to be markup."""
    scan = ScanFolder(tmp_path / "before" / "results", "rock1")
    build.write_all(scan)
    shutil.copytree(tmp_path / "before", tmp_path / "after")
    moved = ScanFolder(tmp_path / "after" / "results", "rock1")
    write_json(moved.qa, {**read_json(moved.qa), "reasons": [build.reason(message=HOSTILE)]})
    build.write_cloud(moved, lift_mm=0.25)
    assert main(["diff", str(scan.results), str(moved.results), "--page", str(tmp_path / "page.html")]) == 1
    return (tmp_path / "page.html").read_text(encoding="utf-8")


def test_it_stands_alone(page: str) -> None:
    assert "default-src 'none'" in page
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert sources
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in sources)
    targets = set(re.findall(r'id="([^"]*)"', page))
    assert {source[1:] for source in sources if source.startswith("#")} <= targets


def test_what_people_typed_cannot_become_markup(page: str) -> None:
    assert "<script" not in page
    assert "<img src=x" not in page
    assert "&lt;script&gt;" in page
    assert "{{ 7*7 }}" in page


def test_the_map_is_embedded(page: str) -> None:
    encoded = re.search(r"data:image/png;base64,([^\"]*)", page)
    assert encoded is not None
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(encoded[1]), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[1] == 128
    assert "+0.25" in page


def test_the_scale_is_even_and_robust() -> None:
    noise = np.random.default_rng(2).normal(0, 0.1, (100, 100))
    noise[0, :50] = 1e3
    noise[1] = np.nan
    scale = signed_scale(noise)
    assert scale.low == -scale.high
    assert scale.high == pytest.approx(0.233 * 1.03, rel=0.05)  # of |normal|, with the outliers, the 98th percentile


def test_signed_colours() -> None:
    """Blue below, red above, paper where nothing changed; a whole field without change has a scale, too."""
    low, middle, high = coloured(np.array([[-1.0, 0.0, 1.0]]), signed_scale(np.array([[-1.0, 1.0]])))[0].astype(int)
    assert low[0] > low[2] + 50
    assert high[2] > high[0] + 50
    assert middle.min() > 230
    assert signed_scale(np.zeros((4, 4))).high > 0
    assert difference_picture("rock1", np.full((40, 60), np.nan)).width == 60
