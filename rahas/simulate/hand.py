"""The operator's hand: when the lamp burns, how lever and crank turn, how the rig shakes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.simulate.specs import HandSpec, RigSpec
from rahas.typing import FloatArray

TIME_STEP_S = 0.001


class Motion(NamedTuple):
    """The film's course at fine even time steps, all of shape (time,)."""

    time_s: FloatArray
    lamp: FloatArray
    """0 off, 1 on."""
    theta: FloatArray
    """Slide angle, rad."""
    crank: FloatArray
    """Tilt of the projector in rad, or displacement of the slide in slide coordinates; 0 at the reference position."""
    jitter_x: FloatArray
    """Displacement of the object in the image, px."""
    jitter_y: FloatArray

    def at(self, name: str, time_s: FloatArray) -> FloatArray:
        """One of the courses at any times, linear between its steps."""
        return np.asarray(np.interp(time_s, self.time_s, getattr(self, name)))


def motion_of(hand: HandSpec, rig: RigSpec, *, centre_v: float, seed: int) -> Motion:
    """The course of a capture; ``centre_v`` is the slide coordinate at the field's centre, for the periods asked."""
    rng = np.random.default_rng([seed, 11])
    time = np.arange(0, hand.duration_s + 1, TIME_STEP_S)
    on = hand.dark_before_s
    rotation_start = on + hand.hold_before_s
    rotation_end = rotation_start + hand.rotation_s
    crank_start = rotation_end + hand.hold_between_s
    crank_end = crank_start + hand.crank_s
    off = crank_end + hand.hold_after_s if hand.dark_after_s else np.inf

    lever = _course((time - rotation_start) / max(hand.rotation_s, 1e-9), _speed(hand, rng, pauses=False))
    wheel = _course((time - crank_start) / max(hand.crank_s, 1e-9), _speed(hand, rng, pauses=True))
    stops = np.deg2rad([rig.first_stop_deg, rig.second_stop_deg])
    theta = stops[0] + (stops[1] - stops[0]) * (lever if hand.rotation_s else np.zeros_like(time))
    travel = crank_travel(rig, periods=hand.periods, v=centre_v) if hand.crank_s else 0.0
    jitter = _bumps(hand, time)
    hands_on = (time > rotation_start - 0.2) & (time < crank_end + 0.2)
    jitter += hand.tremor_px / np.sqrt(2) * _tremor(time, rng) * hands_on[:, None]
    lamp = ((time >= on) & (time < off)).astype(float)
    return Motion(time, lamp, theta, travel * wheel, jitter[:, 0], jitter[:, 1])


def crank_travel(rig: RigSpec, *, periods: float, v: float) -> float:
    """Tilt (rad) or displacement that moves the pattern by ``periods`` at slide coordinate ``v``, downwards."""
    shift = 2 * periods / rig.stripes
    if rig.crank == "translation":
        return shift
    tangent = np.tan(np.deg2rad(rig.half_field_deg))
    return float(np.arctan(tangent * v) - np.arctan(tangent * (v - shift)))


def _speed(hand: HandSpec, rng: np.random.Generator, *, pauses: bool) -> FloatArray:
    """Speed over the course (1001,): slow at both ends, uneven between, standing or backwards in its pauses."""
    x = np.linspace(0, 1, 1001)
    speed = np.sin(np.pi * x) ** 0.8
    for cycles in (1.7, 3.1, 5.3, 8.9):
        swing = hand.jerk * rng.uniform(0.3, 0.8) * cycles**-0.35
        speed = speed * (1 + swing * np.sin(2 * np.pi * (cycles * x + rng.uniform())))
    for pause in hand.pauses if pauses else ():
        inside = 0.5 * (np.tanh((x - pause.at) / 0.006) - np.tanh((x - pause.at - pause.length) / 0.006))
        speed = speed * (1 - inside) - pause.back * speed.mean() * inside
    return speed


def _course(x: FloatArray, speed: FloatArray) -> FloatArray:
    """Share of the way gone at shares ``x`` of the time: 0 before, 1 after."""
    way = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)])
    return np.asarray(np.interp(x, np.linspace(0, 1, len(speed)), way / way[-1]))


def _bumps(hand: HandSpec, time: FloatArray) -> FloatArray:
    total = np.zeros((len(time), 2))
    for bump in hand.bumps:
        since = np.clip(time - bump.at_s, 0, None)
        ring = bump.peak_px * np.exp(-since / bump.decay_s) * np.sin(2 * np.pi * bump.frequency_hz * since)
        direction = np.deg2rad(bump.direction_deg)
        total += ring[:, None] * [np.cos(direction), np.sin(direction)]
    return total


def _tremor(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Hand tremor of unit rms, 2–9 Hz (time, 2)."""
    total = np.zeros((len(time), 2))
    for frequency in rng.uniform(2, 9, 12):
        total += np.sin(2 * np.pi * (frequency * time[:, None] + rng.uniform(size=2)))
    return np.asarray(total / total.std())
