"""Figures show what they should: colours, hatch, fields, snakes, light, plots."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rahas.report.colours import WHOLE_TURN, Scale, coloured, identity_colour, scale_of
from rahas.report.figures import field_figure, first_field, grey_picture, levels_of
from rahas.report.gallery import moments_of
from rahas.report.overlays import arrow_magnification, unrotated, with_snakes
from rahas.report.plots import line_plot, strip_of
from rahas.report.relief import relief_picture
from rahas.report.words import measured_against, metric_label, metric_unit, number, value_text


def test_nan_is_neutral_and_values_are_monotone_in_lightness() -> None:
    values = np.linspace(0, 1, 256, dtype=np.float32)[None].repeat(20, axis=0)
    values[:, 100:110] = np.nan
    picture = coloured(values, Scale(0, 1, "mm"))
    hatch = picture[:, 100:110].astype(int)
    assert np.ptp(hatch, axis=2).max() <= 12
    lightness = cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)[0, :, 0].astype(int)
    steps = np.diff(lightness[np.isfinite(values[0])])
    assert steps.min() >= -2
    assert lightness[-1] - lightness[0] > 120


def test_wrapped_phase_has_no_seam() -> None:
    ends = coloured(np.array([[-np.pi, np.pi]]), WHOLE_TURN).astype(int)
    assert np.abs(ends[0, 0] - ends[0, 1]).max() <= 12


def test_a_scale_of_nothing_or_of_one_value_is_usable() -> None:
    for values in (np.full((4, 4), np.nan), np.full((4, 4), 7.5)):
        scale = scale_of(values, unit="mm")
        assert scale.high > scale.low
        assert field_figure("x.png", values, scale, "x").image.dtype == np.uint8


def test_colours_of_neighbouring_snakes_differ() -> None:
    for identity in range(1, 60):
        here, there = np.array(identity_colour(identity)), np.array(identity_colour(identity + 1))
        assert np.abs(here - there).max() > 90


@pytest.mark.parametrize(("order", "start"), [("top_first", 0), ("bottom_first", 1)])
def test_the_first_field_stands_where_its_rows_were(order: str, start: int) -> None:
    frame = np.zeros((40, 8), np.uint8)
    frame[start::2] = np.arange(20, dtype=np.uint8)[:, None] * 10
    frame[1 - start :: 2] = 255
    shown = first_field(frame, order)
    np.testing.assert_array_equal(shown[start::2], frame[start::2])
    assert abs(int(shown[start + 1, 0]) - 5) <= 1


def test_a_frame_of_any_depth_is_shown_alike() -> None:
    eight = np.tile(np.arange(0, 250, 2, dtype=np.uint8), (40, 1))
    sixteen = eight.astype(np.uint16) * 4
    difference = grey_picture(eight, levels_of([eight])).astype(int) - grey_picture(sixteen, levels_of([sixteen]))
    assert np.abs(difference).max() <= 6


def test_unrotation_turns_as_the_canvas_is_defined() -> None:
    picture = np.zeros((101, 141, 3), np.uint8)
    picture[50, 100] = 255  # 30 px to the right of the centre
    turned = unrotated(picture, 90.0)
    row, column = np.unravel_index(turned[..., 0].argmax(), turned.shape[:2])
    # the blank corners of the canvas are lighter than the dot's surroundings, so look near the expected place
    assert turned[80, 70, 0] > 200, (row, column)


def test_snakes_are_drawn_where_they_are_and_broken_where_blank() -> None:
    ground = np.full((60, 80, 3), 100, np.uint8)
    identity = np.ones((1, 80), np.int16)
    identity[0, 30:50] = 0
    rows = np.full((1, 80), 40.0, np.float32)
    drawn = with_snakes(ground, identity, rows, unrotation_deg=0.0)
    colour = np.array(identity_colour(1))
    assert np.abs(drawn[40, 60].astype(int) - colour).max() <= 30
    assert np.ptp(drawn[40, 33:47].astype(int)) == 0
    assert np.ptp(drawn[15, :].astype(int)) == 0


def test_relief_is_lit_from_the_upper_left() -> None:
    y, x = np.indices((80, 100), dtype=np.float32)
    dome = 20 * np.exp(-((x - 50) ** 2 + (y - 40) ** 2) / 200)
    xyz = np.stack([x, -y, dome], axis=2)
    picture = relief_picture(xyz).astype(int)
    assert picture[33, 43, 0] > picture[40, 5, 0] + 10 > picture[47, 57, 0] + 30


def test_moments_are_inside_their_intervals_and_in_order() -> None:
    intervals = [
        {"stage": "hold", "first": 0, "last": 9},
        {"stage": "rotation", "first": 10, "last": 109},
        {"stage": "hold", "first": 110, "last": 119},
        {"stage": "scan", "first": 120, "last": 160},
    ]
    moments = moments_of({"intervals": intervals}, 161)
    assert [m.part for m in moments] == [
        "first hold", "rotation, early", "rotation, middle", "rotation, late", "reference hold", "scan",
    ]  # fmt: skip
    assert [m.frame for m in moments] == [4, 25, 60, 94, 114, 140]
    assert moments_of({"intervals": intervals}, 50)[-1].frame < 50
    assert [m.frame for m in moments_of(None, 2)] == [0, 1]
    assert moments_of(None, 0) == []


def test_a_plot_breaks_at_gaps_and_keeps_to_its_frame() -> None:
    timeline = {"frames": 10, "frame_rate": 30.0, "intervals": [{"stage": "scan", "first": 0, "last": 9}]}
    plot = line_plot("step", "rad", [None, 0.0, 1.0, None, float("nan"), 5.0, 9.3, None, None, None], timeline)
    assert plot is not None
    assert len(plot.lines) == 2
    rows = [float(point.split(",")[1]) for line in plot.lines for point in line.split()]
    assert min(rows) >= 9.9
    assert max(rows) <= 96.1
    assert line_plot("none", "", [None] * 10, timeline) is None
    flat = line_plot("flat", "", [0.0] * 10, timeline)
    assert flat is not None
    assert len(flat.lines) == 1


def test_the_strip_covers_the_capture_once() -> None:
    intervals = [{"stage": "hold", "first": 0, "last": 19}, {"stage": "scan", "first": 20, "last": 99}]
    strip = strip_of({"frames": 100, "frame_rate": 25.0, "intervals": intervals}, [10, 60])
    assert sum(band.width for band in strip.bands) == pytest.approx(666.0, abs=0.2)
    assert strip.bands[1].x == pytest.approx(strip.bands[0].x + strip.bands[0].width, abs=0.2)
    assert [mark.label for mark in strip.marks] == ["a", "b"]
    assert strip.seconds[-1].label == "4"


@pytest.mark.parametrize(
    ("value", "text"),
    [(3.41234, "3.41"), (0.0, "0"), (-12.5, "−12.5"), (0.00213, "0.00213"), (1234.5, "1234"), (float("nan"), "—")],
)
def test_numbers_to_read(value: float, text: str) -> None:
    assert number(value) == text


def test_values_and_findings_in_words() -> None:
    assert value_text(None, "px") == "—"
    assert value_text(True) == "yes"
    assert value_text("none") == "none"
    finding = {"rule": "calibration", "metric": "marks_found", "value": 9, "limit": 14, "unit": "marks"}
    assert measured_against(finding) == "calibration: marks recognised 9\u202fmarks, limit 14\u202fmarks"
    assert measured_against({"rule": "timeline", "metric": "stages", "value": None}) == "timeline"


def test_an_unknown_metric_is_named_by_its_own_words() -> None:
    assert (metric_label("ripple_before_mm"), metric_unit("ripple_before_mm")) == ("ripple before", "mm")
    assert (metric_label("lit_share"), metric_unit("lit_share")) == ("lit share", "")
    assert (metric_label("jitter"), metric_unit("jitter")) == ("jitter", "px")


def test_arrows_are_enlarged_to_be_seen() -> None:
    marks = [{"residual_x_px": 0.3, "residual_y_px": 0.0}, {"residual_x_px": 0.0, "residual_y_px": -0.1}]
    times = arrow_magnification(marks)
    assert 10 <= 0.3 * times <= 34
    assert arrow_magnification([{}]) == 0
