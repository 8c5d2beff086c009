"""The course of a capture: what the hand does, and the contract's definitions of its parts."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.simulate.capture import stage
from rahas.simulate.examples import example
from rahas.simulate.hand import crank_travel, motion_of
from rahas.simulate.pattern import pattern_phase
from rahas.simulate.specs import BumpSpec, HandSpec, PauseSpec, RigSpec
from rahas.simulate.truth import intervals_of, stages_of


def test_stages_follow_the_contracts_thresholds():
    theta = np.array([0, 0, 0, 0.4, 0.6, 40, 89.4, 89.6, 90, 90, 90, 90, 90, 90, 90, 90])
    step = -np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 0.04, 0.06, 3, 6.23, 6.26, 6.283, 6.283])
    lamp = np.arange(len(theta)) > 0
    assert intervals_of(stages_of(lamp, theta, step)) == [
        {"stage": "dark", "first": 0, "last": 0},
        {"stage": "hold", "first": 1, "last": 3},
        {"stage": "rotation", "first": 4, "last": 6},
        {"stage": "hold", "first": 7, "last": 9},
        {"stage": "scan", "first": 10, "last": 12},
        {"stage": "hold", "first": 13, "last": 15},
    ]


def test_a_usual_capture_has_every_part_in_order_and_covers_itself():
    truth = stage(example("plane", short=True)).truth()
    assert list(truth["interval_stage"]) == ["dark", "hold", "rotation", "hold", "scan", "hold", "dark"]
    assert truth["interval_first"][0] == 0
    assert truth["interval_last"][-1] == len(truth["theta"]) - 1 == 179
    assert np.array_equal(truth["interval_first"][1:], truth["interval_last"][:-1] + 1)


@pytest.mark.parametrize(("hand", "missing"), [({"rotation_s": 0.0}, "rotation"), ({"crank_s": 0.0}, "scan")])
def test_a_part_can_be_left_out(hand, missing):
    truth = stage(example("plane", short=True, hand=hand)).truth()
    assert missing not in truth["interval_stage"]


def test_lamp_may_stay_on_to_the_end():
    truth = stage(example("plane", short=True, hand={"dark_after_s": 0.0, "dark_before_s": 0.0})).truth()
    assert "dark" not in truth["interval_stage"]


@pytest.mark.parametrize("crank", ["tilt", "translation"])
@pytest.mark.parametrize("periods", [1.6, -0.7])
def test_crank_moves_the_asked_periods_at_the_fields_centre(crank, periods):
    rig = RigSpec(crank=crank)
    travel = crank_travel(rig, periods=periods, v=0.1)
    phase = [pattern_phase(rig, 0.0, 0.1, theta=np.pi / 2, crank=c) for c in (0.0, travel)]
    assert (phase[0] - phase[1]) / (2 * np.pi) == pytest.approx(periods, abs=1e-9)


def test_a_tilted_projector_steps_unevenly_over_the_field_and_a_slid_slide_evenly():
    steps = {}
    for crank in ("tilt", "translation"):
        rig = RigSpec(crank=crank)
        travel, v = crank_travel(rig, periods=1.5, v=0.0), np.array([-1.0, 0.0, 1.0])
        steps[crank] = pattern_phase(rig, 0.0, v, theta=np.pi / 2, crank=travel) - pattern_phase(
            rig, 0.0, v, theta=np.pi / 2, crank=0.0
        )
    assert np.ptp(steps["translation"]) < 1e-9
    assert 0.05 < np.ptp(np.abs(steps["tilt"])) / np.abs(steps["tilt"][1]) < 0.2


def test_hand_is_uneven_but_reaches_both_stops_and_can_stall_or_slip():
    rig = RigSpec(second_stop_deg=90.6)
    motion = motion_of(HandSpec(jerk=0.6), rig, centre_v=0.0, seed=3)
    speed = np.diff(motion.theta)
    assert motion.theta[0] == 0
    assert np.rad2deg(motion.theta[-1]) == pytest.approx(90.6)
    assert speed.min() >= 0
    assert speed.max() > 1.3 * speed[speed > 0].mean()
    stalled = motion_of(HandSpec(pauses=(PauseSpec(at=0.5, length=0.2),)), rig, centre_v=0.0, seed=3)
    slipped = motion_of(HandSpec(pauses=(PauseSpec(at=0.5, length=0.1, back=0.5),)), rig, centre_v=0.0, seed=3)
    moving = slice(*np.searchsorted(motion.time_s, [9.2, 12.6]))
    assert np.diff(stalled.crank[moving]).min() < 1e-3 * np.diff(stalled.crank[moving]).max()
    assert np.diff(slipped.crank).min() < 0
    assert slipped.crank[-1] == pytest.approx(motion.crank[-1])


def test_bump_jumps_and_rings_down():
    bump = BumpSpec(at_s=4.0, peak_px=6.0, frequency_hz=4.0, decay_s=0.5, direction_deg=90.0)
    motion = motion_of(HandSpec(bumps=(bump,)), RigSpec(), centre_v=0.0, seed=0)
    before, after = motion.time_s < 4, (motion.time_s > 4) & (motion.time_s < 5)
    assert np.all(motion.jitter_y[before] == 0)
    assert 4.5 < motion.jitter_y[after].max() < 6.0
    assert np.abs(motion.jitter_x).max() < 1e-9
    assert np.abs(motion.jitter_y[motion.time_s > 7]).max() < 0.05
