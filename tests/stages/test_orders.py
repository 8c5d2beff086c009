"""Orders from the rotation against rendered truth, and the vote with snakes that went wrong."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from rahas.kernels.interlacing import PROGRESSIVE, fields
from rahas.kernels.phase_shifting import HarmonicSums, weights_of_least_squares
from rahas.kernels.unwrapping import UNKNOWN_ORDER
from rahas.simulate.capture import render
from rahas.simulate.examples import example
from rahas.stages import orders
from rahas.stages.rotation_frames import Rotation, Scanned, rotation_of_timeline

TURN = 2 * np.pi
RIG = {"centre_u": 0.02, "centre_v": 0.015, "second_stop_deg": 90.6}


class Scene(NamedTuple):
    """A capture with all that the stage is given, and truth."""

    frames: np.ndarray
    rotation: tuple[int, int]
    first_hold: tuple[int, int]
    angle_deg: np.ndarray
    fields: list[slice]
    scanned: Scanned
    true_order: np.ndarray  # (y, x) counted from the slide's axis
    counted: np.ndarray  # (y, x) lit, measured, and noise at most half the stripes' amplitude


def scene_of(
    frames: np.ndarray,
    *,
    theta_deg: np.ndarray,
    step: np.ndarray,
    phase: np.ndarray,
    lit: np.ndarray,
    rotation: tuple[int, int],
    first_hold: tuple[int, int],
    scan: tuple[int, int],
    field_order: str = PROGRESSIVE,
) -> Scene:
    """``step`` (field, frame): phase solved with one step a frame for the whole field, so not better than roughly."""
    rows_of = fields(field_order != PROGRESSIVE, field_order)
    maps = np.zeros((4, *phase.shape), np.float32)
    for rows, own in zip(rows_of, step, strict=True):
        sums = HarmonicSums(phase[rows].shape, own, weights_of_least_squares(own))
        sums.add(frames[scan[0] - 4 : scan[1] + 1, rows])
        found = sums.maps()
        parts = (found.wrapped_phase, found.background, found.modulation, found.residual_std)
        for target, part in zip(maps, parts, strict=True):
            target[rows] = part
    wrapped, background, modulation, noise = maps
    noise = np.maximum(noise, 0.3)
    rough = np.sin(np.linspace(0, 9, len(theta_deg)))  # the timeline's angles are good to a degree or two
    true = theta_deg - theta_deg[0]
    angle = true * 90 / true[-1] + 1.5 * rough * np.sin(np.deg2rad(2 * true))
    measured = modulation > 2.0 * noise
    return Scene(
        frames,
        rotation,
        first_hold,
        angle,
        rows_of,
        Scanned(wrapped, background, modulation, measured),
        np.rint((phase - wrapped) / TURN).astype(int),
        lit & measured,
    )


@cache
def rendered(name: str) -> Scene:
    spec = {
        "steps": lambda: example("steps", short=True, rig=RIG),
        "noisy stone": lambda: example(
            "metate", short=True, rig=RIG, scene={"size_mm": 180.0}, camera={"read_noise": 0.06}
        ),
        "stops and baseline off": lambda: example(
            "steps",
            short=True,
            rig={**RIG, "baseline_tilt_deg": 3.0, "first_stop_deg": 2.0, "second_stop_deg": 91.0},
            scene={"turn_deg": 25.0},
        ),
        "fields, flicker, gamma": lambda: example(
            "steps",
            short=True,
            rig={**RIG, "second_harmonic": 0.1},
            camera={"fields": "bottom_first", "flicker": 0.03, "gamma": 1.8, "ambient": 0.04, "ambient_drift": 0.4},
        ),
        "roof": lambda: example("roof", short=True, rig=RIG),
    }[name]()
    frames, truth = render(spec)
    spans = list(zip(truth["interval_stage"], truth["interval_first"], truth["interval_last"], strict=True))
    turning = next(n for n, span in enumerate(spans) if span[0] == "rotation")
    scan = next((int(a), int(b)) for stage, a, b in spans if stage == "scan")
    return scene_of(
        frames,
        theta_deg=np.rad2deg(truth["theta"]),
        step=truth["field_phase_step"][:, scan[0] - 4 : scan[1] + 1],
        phase=truth["unwrapped_phase"],
        lit=truth["lit"],
        rotation=(int(spans[turning][1]), int(spans[turning][2])),
        first_hold=(int(spans[turning - 1][1]), int(spans[turning - 1][2])),
        scan=scan,
        field_order=spec.camera.fields,
    )


def mirrored(scene: Scene) -> Scene:
    maps = (values[:, ::-1] for values in scene.scanned)
    return scene._replace(
        frames=scene.frames[..., ::-1],
        scanned=Scanned(*maps),
        true_order=scene.true_order[:, ::-1],
        counted=scene.counted[:, ::-1],
    )


def fitted_to(scene: Scene, sense: int = 1) -> orders.RotationFit:
    first, last = scene.rotation
    rotation = Rotation(first, last, scene.first_hold, scene.angle_deg, sense)
    return orders.fit(scene.frames, rotation, fields=scene.fields, scanned=scene.scanned)


def coded(scene: Scene, sense: int = 1) -> orders.CodeOrders:
    fitted = fitted_to(scene, sense)
    assert not fitted.codes or 0 <= fitted.zero_residual_turns < 0.02
    return orders.search(fitted, scene.scanned)


def wrong_of(scene: Scene, order: np.ndarray, zero: int) -> np.ndarray:
    return scene.counted & (order != UNKNOWN_ORDER) & (order - zero != scene.true_order)


@pytest.mark.parametrize("name", ["steps", "noisy stone", "stops and baseline off", "fields, flicker, gamma"])
def test_orders_without_snakes(name: str) -> None:
    scene = rendered(name)
    code = coded(scene)
    wrong, known = wrong_of(scene, code.order, 0), scene.counted & (code.order != UNKNOWN_ORDER)
    assert known.sum() == scene.counted.sum() > 5000
    assert wrong.sum() / known.sum() < 2e-3
    assert (wrong & (code.confidence > 0.3)).sum() / known.sum() < 1e-4
    assert 0.1 < np.percentile(code.confidence[known], 2) <= 1
    assert code.confident_share > 0.95
    alone, _ = orders.vote(np.full(code.order.shape, UNKNOWN_ORDER), np.zeros(code.order.shape), code)
    voted = scene.counted & (alone.order != UNKNOWN_ORDER)
    assert voted.sum() / scene.counted.sum() > 0.99
    assert wrong_of(scene, alone.order, 0).sum() / scene.counted.sum() < 5e-4
    assert alone.disagreement is None


def test_turning_the_other_way() -> None:
    scene = mirrored(rendered("steps"))
    code = coded(scene, sense=-1)
    assert wrong_of(scene, code.order, 0).sum() / scene.counted.sum() < 2e-3


def test_vote_mends_snakes() -> None:
    scene = rendered("steps")
    code = coded(scene)
    true = scene.true_order + 5
    snakes = np.where(scene.counted, true, UNKNOWN_ORDER).astype(np.int16)
    snakes[:, 260:330] += 1  # tracked on to the wrong stripe behind a step
    snakes[:40] = UNKNOWN_ORDER  # and lost
    share = np.mean((snakes != true)[scene.counted & (snakes != UNKNOWN_ORDER)])
    votes, first = orders.vote(snakes, np.full(snakes.shape, 0.9, np.float32), code)
    assert votes.offset == 5
    assert votes.disagreement == pytest.approx(share, abs=0.005)
    assert share > 0.15
    assert wrong_of(scene, votes.order, 5).sum() / scene.counted.sum() < 1e-3
    assert (votes.order != UNKNOWN_ORDER)[scene.counted].mean() > 0.999
    assert first is not None
    assert code.first_phase is not None
    assert first[0] - code.first_phase[0] == 5
    untouched = (snakes == true) & scene.counted
    assert np.median(votes.confidence[untouched]) > 0.99
    contested = scene.counted & (snakes != true) & (snakes != UNKNOWN_ORDER)
    assert np.median(votes.confidence[contested]) < 0.8


def test_doubtful_code_leaves_the_snakes_alone() -> None:
    shape = (40, 50)
    snakes = np.full(shape, 7, np.int16)
    code = orders.CodeOrders(np.full(shape, 3, np.int16), np.full(shape, 0.03, np.float32), None, 0.0)
    votes, first = orders.vote(snakes, np.full(shape, 0.9, np.float32), code, offset=0)
    assert np.all(votes.order == 7)
    assert first is None
    assert votes.disagreement is None


def test_scan_and_calibration_share_their_zero() -> None:
    stone, roof = rendered("noisy stone"), rendered("roof")
    scan, calibration = coded(stone), coded(roof)
    snakes = (roof.true_order + 4).astype(np.int16)  # the calibration's labels
    _, labelled = orders.vote(snakes, np.full(snakes.shape, 0.9, np.float32), calibration)
    assert labelled is not None
    assert scan.first_phase is not None
    offset, residual = orders.offset_to_calibration(scan.first_phase, labelled)
    assert residual < 0.02
    votes, first = orders.vote(
        np.full(scan.order.shape, UNKNOWN_ORDER), np.zeros(scan.order.shape), scan, offset=offset
    )
    assert wrong_of(stone, votes.order, 4).sum() / stone.counted.sum() < 1e-3
    assert first is not None
    assert abs(first[0] - labelled[0]) < 0.5


def test_labels_stay_together_whatever_the_fit_counted_from() -> None:
    scene = rendered("steps")
    code, fitted = coded(scene), fitted_to(scene)
    moved = fitted._replace(last_turns=fitted.last_turns + 2, first_turns=fitted.first_turns + 1)
    other = orders.search(moved, scene.scanned)
    np.testing.assert_array_equal(other.order[scene.counted], code.order[scene.counted] + 2)
    assert other.first_phase is not None
    assert code.first_phase is not None
    assert other.first_phase[0] == pytest.approx(code.first_phase[0] + 1)


@pytest.mark.parametrize("before", ["hold", "dark"])
def test_rotation_as_the_timeline_tells_it(before: str) -> None:
    found = rotation_of_timeline(
        {
            "intervals": [
                {"stage": before, "first": 0, "last": 4},
                {"stage": "rotation", "first": 5, "last": 9},
                {"stage": "hold", "first": 10, "last": 11},
            ],
            "slide_angle_deg": [None, *range(11)],
            "rotation_sense": -1,
        }
    )
    assert (found.first, found.last, found.sense) == (5, 9, -1)
    assert found.first_hold == ((0, 4) if before == "hold" else (5, 5))
    assert np.isnan(found.slide_angle_deg[0])
    assert found.slide_angle_deg[11] == 10


def test_no_rotation_no_orders() -> None:
    scene = rendered("steps")
    still = np.repeat(scene.frames[scene.first_hold[0]][None], len(scene.frames), axis=0)
    noise = np.random.default_rng(1).integers(-3, 4, still.shape)
    code = coded(scene._replace(frames=(still + noise).clip(0, 255).astype(np.uint8)))
    assert np.all(code.order == UNKNOWN_ORDER)
    assert code.first_phase is None
    votes, _ = orders.vote(np.full(code.order.shape, 2, np.int16), np.ones(code.order.shape), code)
    assert np.all(votes.order == 2)


EXTRA = os.environ.get("RAHAS_EXTRA_DATA", "")


@pytest.mark.parametrize("scan_id", ["tricircleC", "interlacedC", "farC"])
def test_captures_of_an_independent_renderer(scan_id: str) -> None:
    folder = Path(EXTRA) / "expedition_c"
    if not EXTRA or not folder.is_dir():
        pytest.skip("RAHAS_EXTRA_DATA does not name a folder with expedition_c")
    av = pytest.importorskip("av")
    video = next(p for p in (folder / "captures").iterdir() if p.stem == scan_id and "texture" not in p.name)
    with av.open(str(video)) as container:
        planes = [(f.planes[0], f.height, f.width) for f in container.decode(video=0)]
        stack = np.stack([np.frombuffer(p, np.uint8).reshape(-1, p.line_size)[:h, :w] for p, h, w in planes])
    truth = np.load(folder / "truth" / f"{scan_id}.npz")
    stop = np.deg2rad(90.6)
    phase = np.pi * 20 * ((truth["u"] - 0.02) * np.cos(stop) + (truth["v"] - 0.015) * np.sin(stop))
    count = len(truth["theta"]) // len(stack)
    theta = np.rad2deg(truth["theta"][::count])
    step = np.stack([truth["tilt"][k::count] for k in range(count)])
    step *= -1.6 * TURN / truth["tilt"][-1]
    turning = np.flatnonzero((theta > 0.5) & (theta < theta[-1] - 0.5))
    moving = np.flatnonzero((np.abs(step[0]) > 0.05) & (np.abs(step[0] - step[0, -1]) > 0.05))
    lit_first = int(np.argmax(stack.mean(axis=(1, 2)) > 0.5 * stack[turning[0]].mean()))
    scan = (int(moving[0]), int(moving[-1]))
    scene = scene_of(
        stack,
        theta_deg=theta,
        step=step[:, scan[0] - 4 : scan[1] + 1],
        phase=phase,
        lit=truth["lit"],
        rotation=(int(turning[0]), int(turning[-1])),
        first_hold=(lit_first, int(turning[0]) - 1),
        scan=scan,
        field_order="top_first" if count == 2 else PROGRESSIVE,
    )
    code = coded(scene)
    assert wrong_of(scene, code.order, 0).sum() / scene.counted.sum() < 5e-3
    votes, _ = orders.vote(np.full(code.order.shape, UNKNOWN_ORDER), np.zeros(code.order.shape), code)
    assert wrong_of(scene, votes.order, 0).sum() / scene.counted.sum() < 1e-3
    assert (votes.order != UNKNOWN_ORDER)[scene.counted].mean() > 0.99
