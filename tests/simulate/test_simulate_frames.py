"""Second half of the renderer: what the frames show, against the truth that goes with them."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.simulate.capture import render, stage
from rahas.simulate.examples import example
from rahas.simulate.frames import _moved, filmed_frames, render_frames
from rahas.simulate.hand import motion_of
from rahas.simulate.maps import Maps, maps_of, surface_of
from rahas.simulate.pattern import add_pattern, pattern_phase
from rahas.simulate.specs import CameraSpec, HandSpec, RigSpec
from rahas.simulate.surface import ALBEDO_SPACING_MM, HEIGHT_SPACING_MM

LINEAR = {"gamma": 1.0, "peak": 0.8}


def interval(truth, stage_name):
    which = list(truth["interval_stage"]).index(stage_name)
    return slice(truth["interval_first"][which], truth["interval_last"][which] + 1)


def phase_error_over_bound(frames, truth, rig, *, rows):
    """Phase of a least-squares fit with the true steps, minus the true one, over the Cramér–Rao bound (pixel,)."""
    field = 0 if rows.start % 2 == 0 or rows.step == 1 else 1
    scan = interval(truth, "scan")
    columns = slice(10, None, 7)
    u, v = (truth[name][rows, columns].astype(float) for name in ("u", "v"))
    stop = np.deg2rad(rig.second_stop_deg)
    at_rest = pattern_phase(rig, u, v, theta=stop, crank=0.0)
    ratios = []
    codes = frames[scan, rows, columns].astype(float).reshape(scan.stop - scan.start, -1)
    moving = np.stack([pattern_phase(rig, u, v, theta=stop, crank=c) for c in truth["field_crank"][field, scan]])
    steps, at_rest = (moving - at_rest).reshape(codes.shape), at_rest.ravel()
    for pixel in range(codes.shape[1]):
        angle = at_rest[pixel] + steps[:, pixel]
        design = np.stack([np.ones_like(angle), np.cos(angle), -np.sin(angle)], axis=1)
        (_, c, s), rest, *_ = np.linalg.lstsq(design, codes[:, pixel], rcond=None)
        sigma = np.sqrt(rest[0] / (len(angle) - 3))
        bound = sigma / np.hypot(c, s) * np.sqrt(np.linalg.inv(design.T @ design)[2, 2])
        ratios.append(np.arctan2(s, c) / bound)
    return np.array(ratios)


@pytest.mark.parametrize("crank", ["tilt", "translation"])
def test_frames_hold_the_phase_of_the_truth_to_the_noise(crank):
    rig = {"crank": crank, "centre_v": 0.02}
    capture = example("plane", short=True, rig=rig, camera=LINEAR, scene={"texture": 0.3})
    frames, truth = render(capture)
    ratios = phase_error_over_bound(frames, truth, capture.rig, rows=slice(8, None, 9))
    assert 0.9 < np.sqrt(np.mean(ratios**2)) < 1.15
    assert abs(np.mean(ratios)) < 0.15


def test_each_field_of_an_interlaced_frame_has_its_own_time():
    capture = example("plane", short=True, camera={**LINEAR, "fields": "bottom_first", "exposure_s": 0.008})
    frames, truth = render(capture)
    first_rows, second_rows = slice(9, None, 10), slice(8, None, 10)
    truth_by_parity = {**truth, "field_crank": truth["field_crank"][::-1]}  # odd rows are the first field here
    for rows in (first_rows, second_rows):
        ratios = phase_error_over_bound(frames, truth_by_parity, capture.rig, rows=rows)
        assert 0.85 < np.sqrt(np.mean(ratios**2)) < 1.2
    scan = interval(truth, "scan")
    assert np.abs(truth["field_phase_step"][1, scan] - truth["field_phase_step"][0, scan]).max() > 0.05


@pytest.mark.parametrize("lens", [{}, {"projector_radial_k1": 0.3, "slide_shift_rad": 0.7}])
@pytest.mark.parametrize("crank", ["tilt", "translation"])
def test_exposure_integrates_the_moving_pattern(crank, lens):
    rig = RigSpec(crank=crank, stripes=20, centre_u=0.03, contrast=1, second_harmonic=0.1, second_stop_deg=91, **lens)
    v, u = (m.astype(np.float32) for m in np.mgrid[-0.6:0.6:40j, -0.6:0.6:60j])
    light = np.ones_like(u)
    start, end = (0.5, 0.01), (0.5175, 0.015)  # 1° an exposure and the crank as well: more than any hand
    course = [np.cos(start[0]), np.sin(start[0]), start[1], np.cos(end[0]), np.sin(end[0]), end[1], 1.0]
    out = np.zeros_like(u)
    add_pattern(out, (u, v, light), rig, np.tile(course, (len(u), 1)))
    expected = np.zeros(u.shape)
    for share in (np.arange(400) + 0.5) / 400:
        theta, way = (a + share * (b - a) for a, b in zip(start, end, strict=True))
        phase = pattern_phase(rig, u.astype(float), v.astype(float), theta=theta, crank=way)
        expected += 0.5 * (1 + np.cos(phase) + 0.1 * np.cos(2 * phase)) / 400
    assert np.abs(out - expected).max() < 2e-3
    assert np.ptp(expected) > 0.05


def test_pattern_ends_at_the_slides_aperture():
    rig = RigSpec(aperture=0.5)
    u = np.linspace(-0.7, 0.7, 141, dtype=np.float32)[None, :].repeat(3, axis=0)
    out = np.zeros_like(u)
    add_pattern(out, (u, np.zeros_like(u), np.ones_like(u)), rig, np.tile([0.0, 1, 0, 0, 1, 0, 1], (3, 1)))
    assert np.all(out[:, np.abs(u[0]) > 0.51] == 0)
    assert np.all(out[:, np.abs(u[0]) < 0.49] > 0.5)


def test_a_bump_moves_the_object_and_leaves_the_pattern_with_the_rig():
    """Against a scene that was really moved, by whole cells of its grids."""
    capture = example("circle", short=True)
    surface = surface_of(capture)
    maps = maps_of(capture, surface)
    cells_right, cells_down, finer = 5, 3, round(HEIGHT_SPACING_MM / ALBEDO_SPACING_MM)
    right_mm, down_mm = cells_right * HEIGHT_SPACING_MM, cells_down * HEIGHT_SPACING_MM
    moved_surface = surface._replace(
        height=np.roll(surface.height, (-cells_down, cells_right), (0, 1)),
        albedo=np.roll(surface.albedo, (-finer * cells_down, finer * cells_right), (0, 1)),
    )
    expected = maps_of(capture, moved_surface)
    px_per_mm = capture.rig.focal_widths * capture.rig.width_px / capture.rig.working_distance_mm
    u, v, light, _ = _moved(maps, (right_mm * px_per_mm, down_mm * px_per_mm))
    inner = (slice(10, -10), slice(10, -10))
    to_phase = np.pi * capture.rig.stripes
    for got, want in ((u, expected.u), (v, expected.v)):
        assert np.median(np.abs(got - want)[inner]) * to_phase < 0.005
        assert np.percentile(np.abs(got - want)[inner], 99) * to_phase < 0.06
    naive = np.roll(maps.v, (round(down_mm * px_per_mm), round(right_mm * px_per_mm)), (0, 1))
    assert np.median(np.abs(naive - expected.v)[inner]) * to_phase > 0.2, "moving the phase along would be wrong"
    assert np.corrcoef(light[inner].ravel(), expected.light[inner].ravel())[0, 1] > 0.97


def test_the_same_seed_gives_the_same_frames_and_another_does_not():
    hand = {"dark_before_s": 0.1, "hold_before_s": 0.1, "rotation_s": 0.4, "hold_between_s": 0.1, "crank_s": 0.3}
    small = {"width_px": 120, "height_px": 80}
    capture = example("circle", short=True, rig=small, hand={**hand, "tremor_px": 0.1})
    first, again = render(capture), render(capture)
    assert np.array_equal(first.frames, again.frames)
    assert all(np.array_equal(first.truth[name], again.truth[name]) for name in first.truth)
    other = render(capture.model_copy(update={"seed": 2}))
    assert not np.array_equal(first.frames, other.frames)


def test_doubled_and_dropped_frames():
    camera = CameraSpec(doubled=(3, 4), dropped=(6, 7))
    assert list(filmed_frames(camera, 10 / 30)) == [0, 1, 2, 2, 2, 5, 8, 9]
    capture = example("plane", short=True, camera={"doubled": (20,), "dropped": (40,)})
    frames, truth = render(capture)
    assert len(frames) == len(truth["theta"]) == 179
    assert np.array_equal(frames[20], frames[19])
    assert not np.array_equal(frames[40], frames[39])
    assert truth["shows"][40] == 41


def test_noise_is_shot_and_read_noise():
    camera = {**LINEAR, "luma_range": "full", "pedestal": 0.04, "shot_noise": 4e-4, "read_noise": 0.01}
    frames, truth = render(example("plane", short=True, camera=camera))
    hold = frames[interval(truth, "hold")][2:-2].astype(float)
    mean, variance = hold.mean(axis=0).ravel(), hold.var(axis=0, ddof=1).ravel()
    slope, offset = np.polyfit(mean, variance, 1)
    assert slope == pytest.approx(4e-4 * 255 * (1 - 0.04), rel=0.1)
    assert offset + slope * 0.04 * 255 == pytest.approx((0.01 * 255) ** 2 + 1 / 12, rel=0.15)


def test_auto_exposure_and_flicker_change_the_brightness_and_ambient_lights_the_dark():
    plain = stage(example("plane", short=True, camera={"ambient": 0.05}))
    steady = np.array([f.mean() for f in plain.frames()])
    truth = plain.truth()
    swinging = plain._replace(
        capture=example("plane", short=True, camera={"ambient": 0.05, "flicker": 0.05, "auto_exposure": 0.8})
    )
    uneven = np.array([f.mean() for f in swinging.frames()])
    hold = interval(truth, "hold")
    assert np.ptp(steady[hold][1:]) < 0.3
    assert np.ptp(uneven[hold][1:]) > 1.0
    dark = interval(truth, "dark")
    assert 3 < steady[dark].mean() - 16 < 0.5 * (steady[hold].mean() - 16)


def test_maps_of_a_real_object_are_enough_to_film_it():
    v, u = (m.astype(np.float32) for m in np.mgrid[-0.5:0.5:64j, -0.7:0.7:96j])
    maps = Maps(u=u, v=v, light=np.ones_like(u), albedo=np.ones_like(u), slide_gradient=None, points=None)
    rig, hand, camera = RigSpec(stripes=6), HandSpec(tremor_px=0.3), CameraSpec(readout_s=0.02)
    motion = motion_of(hand, rig, centre_v=0.0, seed=4)
    shows = np.array([0, 40, 40, 140, 400])
    dark, first, again, turning, scanned = render_frames(maps, rig, motion, camera, shows=shows, seed=4)
    assert dark.mean() < 25
    assert np.array_equal(first, again)
    assert first.mean(axis=0).std() > 5 * first.mean(axis=1).std(), "upright stripes at the first stop"
    assert scanned.mean(axis=1).std() > 5 * scanned.mean(axis=0).std(), "level stripes at the second"
    assert turning.std() > 15
