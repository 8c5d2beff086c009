"""The timeline against rendered truth: borders by the contract's definitions, angle, step, repeats, refusals."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.kernels.frame_runs import running_median
from rahas.params import TimelineParams
from rahas.simulate.capture import render
from rahas.simulate.examples import example
from rahas.simulate.specs import BumpSpec, PauseSpec
from rahas.stages.timeline import Timeline, find_timeline

FRAME_RATE = 30.0


class Capture(NamedTuple):
    """What the stage is given, and the truth."""

    thumbnails: np.ndarray
    change: np.ndarray
    truth: dict[str, Any]
    stops: tuple[float, float]

    def timeline(self, stack: Any = None) -> Timeline:
        return find_timeline(
            self.thumbnails if stack is None else stack,
            time_s=np.arange(len(self.change)) / FRAME_RATE,
            change=self.change,
            frame_rate=FRAME_RATE,
            params=TimelineParams(),
        )


def thumbnails_of(frames: np.ndarray, first_row: int | None = None) -> np.ndarray:
    """Means over 4 × 4 pixels times 64; of one field over 2 of its rows × 4 columns."""
    rows, field = (4, frames) if first_row is None else (2, frames[:, first_row::2])
    count, height, width = field.shape
    blocks = field[:, : height // rows * rows, : width // 4 * 4].reshape(count, height // rows, rows, width // 4, 4)
    return np.round(blocks.mean(axis=(2, 4), dtype=np.float32) * 64).astype(np.uint16)


def capture_of(kind: str, **parts: Any) -> Capture:
    spec = example(kind, short=True, **parts)  # type: ignore[arg-type]
    frames, truth = render(spec)
    first_row = {"progressive": None, "top_first": 0, "bottom_first": 1}[spec.camera.fields]
    change = np.abs(np.diff(frames.astype(np.int16), axis=0)).mean(axis=(1, 2))
    return Capture(
        thumbnails_of(frames, first_row),
        np.concatenate([[0.0], change]),
        truth,
        (spec.rig.first_stop_deg, spec.rig.second_stop_deg),
    )


@pytest.fixture(scope="module")
def plain() -> Capture:
    return capture_of("tricircle")


def assert_borders(found: Timeline, truth: dict[str, Any], *, within: int = 2) -> None:
    stages = [interval.stage for interval in found.intervals]
    assert stages == [str(stage) for stage in truth["interval_stage"]]
    for interval, first, last in zip(found.intervals, truth["interval_first"], truth["interval_last"], strict=True):
        assert abs(interval.first - first) <= within, interval
        assert abs(interval.last - last) <= within, interval
    covered = [n for interval in found.intervals for n in range(interval.first, interval.last + 1)]
    assert covered == list(range(len(truth["theta"])))


def angle_error(found: Timeline, capture: Capture) -> np.ndarray:
    start, end = capture.stops
    truth = (np.degrees(capture.truth["theta"]) - start) / (end - start) * 90
    return (found.slide_angle_deg - truth)[np.isfinite(found.slide_angle_deg)]


def step_error(found: Timeline, capture: Capture) -> np.ndarray:
    return (found.phase_step_rad - capture.truth["phase_step"])[np.isfinite(found.phase_step_rad)]


CASES: dict[str, dict[str, Any]] = {
    "no dark frames, lamp and exposure unsteady": {
        "kind": "monkey",
        "hand": {"dark_before_s": 0, "dark_after_s": 0},
        "camera": {"flicker": 0.05, "auto_exposure": 0.6, "ambient": 0.1, "ambient_drift": 0.5},
    },
    "stall and slip back, stops off a right angle, slide off centre": {
        "kind": "circle",
        "hand": {"pauses": (PauseSpec(at=0.25, length=0.12), PauseSpec(at=0.6, length=0.08, back=1.0))},
        "rig": {
            "first_stop_deg": 1.0,
            "second_stop_deg": 90.6,
            "centre_u": 0.06,
            "centre_v": -0.04,
            "baseline_tilt_deg": 3,
        },
    },
    "less than a period, short holds, jerky hand": {
        "kind": "monkey",
        "seed": 5,
        "hand": {"periods": 0.8, "jerk": 0.7, "hold_before_s": 0.2, "hold_between_s": 0.1, "hold_after_s": 0.15},
    },
    "several periods upwards, interlaced": {
        "kind": "circle",
        "hand": {"periods": -3.2, "crank_s": 3.0},
        "camera": {"fields": "bottom_first"},
    },
    "small bright object on black": {"kind": "metate", "scene": {"size_mm": 60}, "camera": {"peak": 0.25}},
    "rig knocked in the rotation and after the scan": {
        "kind": "roof",
        "hand": {
            "hold_after_s": 1.0,
            "bumps": (BumpSpec(at_s=1.8, peak_px=2.0), BumpSpec(at_s=5.7, peak_px=2.0, direction_deg=90)),
        },
    },
}


@pytest.mark.parametrize("name", CASES)
def test_borders_angle_and_step(name: str) -> None:
    capture = capture_of(**CASES[name])
    found = capture.timeline()
    assert_borders(found, capture.truth)
    assert found.rotation_sense == 1
    angle, step = angle_error(found, capture), step_error(found, capture)
    assert np.abs(angle).max() < 2.0
    assert np.diff(angle).std() < 0.3
    assert np.sqrt((step**2).mean()) < 0.03
    assert found.periods == pytest.approx(np.ptp(capture.truth["phase_step"]) / (2 * np.pi), abs=0.02)
    assert found.duplicates == []
    assert found.dropped == []


def test_clean_capture_is_measured_finely(plain: Capture) -> None:
    found = plain.timeline()
    assert_borders(found, plain.truth, within=1)
    assert np.abs(angle_error(found, plain)).max() < 0.5
    assert np.sqrt((step_error(found, plain) ** 2).mean()) < 0.012
    moving = np.isfinite(found.phase_step_rad)
    scan = next(interval for interval in found.intervals if interval.stage == "scan")
    assert np.flatnonzero(moving).tolist() == list(range(scan.first, scan.last + 1))
    dark = [n for i in found.intervals if i.stage == "dark" for n in range(i.first, i.last + 1)]
    assert np.flatnonzero(np.isnan(found.slide_angle_deg)).tolist() == dark
    second = found.intervals[3]
    assert np.abs(found.slide_angle_deg[second.first + 3 : scan.last] - 90).max() < 0.2


def test_sense_of_a_mirrored_rig(plain: Capture) -> None:
    mirrored = plain._replace(thumbnails=plain.thumbnails[:, :, ::-1])
    found = mirrored.timeline()
    assert found.rotation_sense == -1
    assert_borders(found, plain.truth, within=1)
    assert np.abs(angle_error(found, plain)).max() < 0.5


def test_stack_read_block_by_block_gives_the_same(plain: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    largest = 0

    class Lazy:
        """Read only by slices, as a long capture's store is."""

        shape, dtype = plain.thumbnails.shape, plain.thumbnails.dtype

        def __getitem__(self, key: slice) -> np.ndarray:
            nonlocal largest
            block = plain.thumbnails[key]
            largest = max(largest, len(block))
            return block

    monkeypatch.setattr("rahas.stages.timeline.IN_MEMORY_BYTES", 0)
    monkeypatch.setattr("rahas.kernels.frame_blocks.BLOCK_FRAMES", 17)
    found, whole = plain.timeline(Lazy()), plain.timeline()
    assert largest <= 40, "a block, or the frames of a hold"
    assert found.intervals == whole.intervals
    np.testing.assert_allclose(found.slide_angle_deg, whole.slide_angle_deg, atol=0.01)
    np.testing.assert_allclose(found.phase_step_rad, whole.phase_step_rad, atol=2e-3)


def test_repeated_and_lost_frames() -> None:
    capture = capture_of("circle", camera={"doubled": (50, 130, 131), "dropped": (70, 120)})
    found = capture.timeline()
    repeats = np.flatnonzero(np.diff(capture.truth["shows"]) == 0) + 1
    lost = np.flatnonzero((np.diff(capture.truth["shows"]) == 2) & (np.arange(len(capture.truth["shows"]) - 1) < 125))
    lost = lost[~np.isin(lost, repeats)]
    assert found.duplicates == repeats.tolist()
    assert [gap.after for gap in found.dropped] == lost.tolist()
    assert {gap.count for gap in found.dropped} == {1}
    assert_borders(found, capture.truth)


def cut(capture: Capture, frames: np.ndarray) -> Capture:
    return capture._replace(thumbnails=capture.thumbnails[frames], change=capture.change[frames])


def frames_of(capture: Capture, *stages: int) -> np.ndarray:
    truth = capture.truth
    return np.concatenate([np.arange(truth["interval_first"][n], truth["interval_last"][n] + 1) for n in stages])


@pytest.mark.parametrize(
    ("stages", "says"),
    [
        ((0, 1), "lever was never turned"),
        ((0, 1, 1, 1, 6), "lever was never turned"),
        ((0, 1, 2, 3, 3), "crank was not turned"),
        ((0, 3, 4, 5, 6), "lie across from the first frame"),
        ((2, 3, 4, 5), "no hold at the first stop"),
    ],
)
def test_missing_stage_is_named(plain: Capture, stages: tuple[int, ...], says: str) -> None:
    with pytest.raises(CaptureProblem, match=says) as caught:
        cut(plain, frames_of(plain, *stages)).timeline()
    assert caught.value.rule == "timeline"
    assert caught.value.metric == "stages"
    assert caught.value.value
    assert "scan" in str(caught.value.limit)


def test_crank_before_the_lever_arrived(plain: Capture) -> None:
    turn, scan = frames_of(plain, 0, 1, 2)[:-12], frames_of(plain, 4, 5, 6)[10:]
    with pytest.raises(CaptureProblem, match="no hold between rotation and scan"):
        cut(plain, np.concatenate([turn, scan])).timeline()


def test_lever_never_turned() -> None:
    capture = capture_of("circle", hand={"rotation_s": 0.0})
    with pytest.raises(CaptureProblem, match="lever was never turned"):
        capture.timeline()


def test_too_short_and_black(plain: Capture) -> None:
    with pytest.raises(CaptureProblem, match="too short"):
        cut(plain, np.arange(5)).timeline()
    black = plain._replace(thumbnails=np.full_like(plain.thumbnails, 64 * 16), change=np.zeros_like(plain.change))
    with pytest.raises(CaptureProblem, match="moving stripes"):
        black.timeline()


def test_median_keeps_slow_starts() -> None:
    course = np.concatenate([np.zeros(20), np.linspace(0, 1, 30) ** 2, np.ones(5)])
    np.testing.assert_array_equal(running_median(course, 9)[:-4], course[:-4])
    jolt = course + np.where(np.arange(55) % 55 == 8, 3.0, 0.0)
    np.testing.assert_allclose(running_median(jolt, 9)[:12], 0)


EXTRA = os.environ.get("RAHAS_EXTRA_DATA", "")


@pytest.mark.parametrize("scan_id", ["calC", "tricircleC", "farC", "bumpedC", "interlacedC"])
def test_captures_of_an_independent_renderer(scan_id: str) -> None:
    folder = Path(EXTRA) / "expedition_c"
    if not EXTRA or not folder.is_dir():
        pytest.skip("RAHAS_EXTRA_DATA does not name a folder with expedition_c")
    av = pytest.importorskip("av")
    video = next(
        path for path in (folder / "captures").iterdir() if path.stem == scan_id and "texture" not in path.name
    )
    truth = np.load(folder / "truth" / f"{scan_id}.npz")
    frames, times = [], []
    with av.open(str(video)) as container:
        for frame in container.decode(video=0):
            plane = frame.planes[0]
            frames.append(np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[: frame.height, : frame.width])
            times.append(frame.time)
    stack = np.stack(frames)
    interlaced = len(truth["theta"]) == 2 * len(stack)
    every = 2 if interlaced else 1
    change = np.concatenate([[0.0], [np.abs(b.astype(np.int16) - a).mean() for a, b in pairwise(stack)]])
    found = find_timeline(
        thumbnails_of(stack, 0 if interlaced else None),
        time_s=np.array(times),
        change=change,
        frame_rate=FRAME_RATE,
        params=TimelineParams(),
    )
    theta, tilt = np.degrees(truth["theta"][::every]), truth["tilt"][::every]
    step = -tilt / tilt[-1] * 1.6 * 2 * np.pi
    turning = np.flatnonzero((theta > 0.5) & (theta < theta[-1] - 0.5))
    moving = np.flatnonzero((np.abs(step) > 0.05) & (np.abs(step - step[-1]) > 0.05))
    by_stage = {interval.stage: interval for interval in found.intervals}
    for stage, expected in (("rotation", turning), ("scan", moving)):
        assert abs(by_stage[stage].first - expected[0]) <= 2
        assert abs(by_stage[stage].last - expected[-1]) <= 2
    dark = [interval for interval in found.intervals if interval.stage == "dark"]
    assert [(i.first, i.last) for i in dark] == ([] if interlaced else [(0, 7)])
    assert found.periods == pytest.approx(1.6, abs=0.02)
    assert found.duplicates == []
    assert found.dropped == []
    if scan_id != "bumpedC":
        angle = found.slide_angle_deg - theta * 90 / theta[-1]
        assert np.nanmax(np.abs(angle)) < 2.0
    assert np.nanmax(np.abs(found.phase_step_rad - step)) < 0.08
