"""The page of a comparison: one file with everything in it, difference maps as embedded pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from rahas.report import comparison_table as told
from rahas.report.colours import INK, PAPER, Scale, bar_of, on_hatch
from rahas.report.figures import field_figure
from rahas.report.pages import template
from rahas.report.words import finding_line, number

MAX_SECTIONS = 200  # rows told one by one; all of them stand in the table
_TAIL_PERCENT = 2.0
_PALETTE, _GREYS = 65, 16  # colours of a picture


class Picture(NamedTuple):
    """A picture inside the page."""

    source: str
    width: int
    height: int
    title: str
    caption: str


class Section(NamedTuple):
    """What one row's part of the page says."""

    scan_id: str
    verdict: str
    reasons: list[tuple[str, str]]
    metrics: list[tuple[str, str, str, str]]
    artifacts: str
    depth: str
    map: Picture | None
    notes: list[str]


def render_comparison(found: Mapping[str, Any], maps: Mapping[str, np.ndarray]) -> str:
    """HTML of a comparison as ``rahas diff --json`` prints it; ``maps`` holds depth differences (y, x) in mm."""
    columns = told.columns()
    differing = [scan for scan in found["scans"] if scan["differs"]]
    shown = sorted(differing, key=lambda scan: scan["scan_id"] not in maps)[:MAX_SECTIONS]
    groups: list[list[Any]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1][1] += 1
        else:
            groups.append([column.group, 1])
    return template("comparison.html.j2").render(
        found=found,
        before=told.side_text(found["before"]),
        after=told.side_text(found["after"]),
        counts=told.headline(found)[-1],
        causes=told.cause_lines(found),
        groups=groups,
        names=[column.name for column in columns],
        rows=[[column.cell(scan) for column in columns] for scan in differing],
        sections=[_section(scan, maps.get(scan["scan_id"])) for scan in shown if not scan["only"]],
        with_section={scan["scan_id"] for scan in shown if not scan["only"]},
        unmapped=sum(bool(scan["depth"]) for scan in differing) - len(maps),
    )


def _section(scan: Mapping[str, Any], difference: np.ndarray | None) -> Section:
    return Section(
        scan_id=scan["scan_id"],
        verdict=told.verdict_change(scan),
        reasons=[
            (side, finding_line(reason))
            for side, reasons in zip(("before", "after"), scan["reasons"], strict=True)
            for reason in reasons
        ],
        metrics=told.metric_changes(scan),
        artifacts=told.artifact_line(scan),
        depth=_depth_line(scan),
        map=None if difference is None else difference_picture(scan["scan_id"], difference),
        notes=list(scan["notes"]),
    )


def _depth_line(scan: Mapping[str, Any]) -> str:
    depth = scan["depth"]
    if not depth:
        return ""
    shares = [number(100 * depth[name] / depth["pixels"]) for name in ("compared", "gained", "lost")]
    return f"Measured on both sides: {shares[0]} % of the image; gained {shares[1]} %, lost {shares[2]} %."


def difference_picture(scan_id: str, difference: np.ndarray) -> Picture:
    """The map of a depth difference (y, x) in mm, its legend even about zero and without the largest values."""
    scale = signed_scale(difference)
    title = f"{scan_id}: ΔZ, after minus before"
    caption = f"mm; {number(100 - _TAIL_PERCENT)} % of the pixels lie within the colours; hatched: not on both sides"
    figure = field_figure("difference.png", difference, scale, title, caption)
    height, width = figure.image.shape[:2]
    source = f"data:image/png;base64,{base64.b64encode(_png(figure.image)).decode()}"
    return Picture(source, width, height, figure.title, figure.caption)


def _png(image: np.ndarray) -> bytes:
    """A picture (y, x, 3) as PNG with a palette: noise in true colour takes three times the room."""
    buffer = io.BytesIO()
    fitted = Image.fromarray(image[..., ::-1]).quantize(palette=_palette(), dither=Image.Dither.NONE)
    fitted.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


@cache
def _palette() -> Image.Image:
    """The colours of the map, evenly, those of the hatch, and the greys of the legend's writing."""
    steps = bar_of(Scale(-1.0, 1.0, "", "signed"), width=_PALETTE, height=1)[0]
    hatch = np.unique(on_hatch(np.zeros((8, 8, 3), np.uint8), np.zeros((8, 8), bool)).reshape(-1, 3), axis=0)
    greys = np.linspace(INK, PAPER, _GREYS).round().astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([steps, hatch, greys])[:, ::-1].tobytes())
    return palette


def signed_scale(difference: np.ndarray) -> Scale:
    """A scale even about zero that leaves the largest magnitudes out."""
    size = np.abs(difference[np.isfinite(difference)])
    reach = float(np.percentile(size, 100.0 - _TAIL_PERCENT)) if size.size else 0.0
    reach = reach or (float(size.max()) if size.size else 0.0) or 1e-3
    return Scale(-reach, reach, "mm", "signed")
