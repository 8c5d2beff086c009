"""A scan's page put together: which figures, plots, facts and links, from the evidence that there is."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from rahas.report import gallery
from rahas.report.figures import Figure
from rahas.report.pages import FileLink, ScanPage, Section
from rahas.report.plots import LinePlot, line_plot, strip_of
from rahas.report.residuals import displacement_series, model_facts, residual_rows, side_remarks, surface_facts

# Artifact below the scan's folder, what it holds, the stage whose record stands beside it.
ARTIFACTS = (
    ("frames.zarr", "frames as shot, times, statistics", "ingest"),
    ("timeline.json", "dark, hold, rotation, scan; slide angle and phase step", "timeline"),
    ("review/capture.json", "review of the capture", "review_capture"),
    ("snakes.zarr", "stripes followed through every frame (Si, Sy, Sp)", "snakes"),
    ("phase.zarr", "wrapped and unwrapped phase, quality, modulation", "phase"),
    ("calibration.json", "camera and projector models, marks, residuals", "calibrate"),
    ("cloud.zarr", "points on the camera's grid, before and after debanding", "cloud"),
    ("cloud.ply", "the cloud for CloudCompare and MeshLab", "cloud"),
    ("review/result.json", "review of the result", "review_result"),
    ("qa.json", "verdict, reasons, metrics", "verdict"),
)


class Composed(NamedTuple):
    """A page and every figure that has to lie in its ``figures/``."""

    page: ScanPage
    figures: list[Figure]


def compose(
    evidence: gallery.Evidence,
    *,
    row: Mapping[str, Any],
    qa: Mapping[str, Any],
    review: Mapping[str, Any] | None,
    present: Collection[str],
) -> Composed:
    """Page of a scan.

    ``row`` is the log's row, ``qa`` the verdict, ``review`` the capture's review if there is one, ``present`` the
    paths below the scan's folder that exist: artifacts and records.
    """
    pictured = gallery.pictured_of(evidence)
    frames = gallery.frame_figures(pictured)
    sections = [section for section in _sections(evidence, pictured) if section.figures]
    thumbnail = gallery.thumbnail(evidence, pictured)
    about_cloud = {} if evidence.cloud is None else dict(evidence.cloud.attrs)
    remarks = [*((evidence.calibration or {}).get("warnings") or []), *(about_cloud.get("warnings") or [])]
    page = ScanPage(
        row=row,
        qa=qa,
        strip=strip_of(evidence.timeline, [moment.frame for moment in pictured.moments]) if evidence.timeline else None,
        frames=frames,
        plots=_plots(evidence.timeline, review),
        sections=sections,
        marks=residual_rows(evidence.calibration),
        facts=[*model_facts(evidence.calibration, told=qa.get("metrics") or ()), *surface_facts(about_cloud)],
        remarks=side_remarks(remarks, qa),
        files=_links(present),
    )
    figures = [*frames, *(figure for section in sections for figure in section.figures)]
    return Composed(page, figures if thumbnail is None else [*figures, thumbnail])


def _sections(evidence: gallery.Evidence, pictured: gallery.Pictured) -> list[Section]:
    return [
        Section("Surface", "in the target's frame", gallery.cloud_figures(evidence)),
        Section("Calibration", "the target's marks", gallery.calibration_figures(evidence, pictured)),
        Section("Stripes", "followed through rotation and scan", gallery.snake_figures(evidence, pictured), "triple"),
        Section("Phase", "at the reference slide position", gallery.phase_figures(evidence)),
    ]


def _plots(timeline: Mapping[str, Any] | None, review: Mapping[str, Any] | None) -> list[LinePlot]:
    if timeline is None:
        return []
    plots = [
        line_plot("slide angle", "degrees", timeline.get("slide_angle_deg") or [], timeline, step=45.0),
        line_plot("phase step at the field's centre", "radians", timeline.get("phase_step_rad") or [], timeline),
        line_plot("displacement of the object", "pixels", displacement_series(review), timeline),
    ]
    return [plot for plot in plots if plot is not None]


def _links(present: Collection[str]) -> list[FileLink]:
    return [
        FileLink(path, holds, record if (record := f"provenance/{stage}.json") in present else None)
        for path, holds, stage in ARTIFACTS
        if path in present
    ]
