"""The rotation code on synthetic pixels: each one's order is drawn by itself, so no neighbour can help."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from rahas.kernels.first_hold_phase import EXPONENTS, first_phase_of_hold, polynomial_terms
from rahas.kernels.order_search import search_orders
from rahas.kernels.rotation_code import RotationCode, blind_start, order_candidates, solve_rotation_code
from rahas.kernels.rotation_model import RotationPixels, course_from_angles, zero_of_course

TURN = 2 * np.pi
SHAPE = (240, 360)
ACROSS, DOWN = 12.0, 9.0  # stripes over the image


class Turning(NamedTuple):
    """A slide turning before a scene without any order."""

    pixels: RotationPixels
    terms: np.ndarray  # (term, pixel)
    first_phase: np.ndarray  # (term), turns, its integer unknown to the solver
    angle_deg: np.ndarray  # (frame) true, from the first stop to the second as 0 … 90
    order: np.ndarray  # (pixel) true, counted from the slide's axis


def turning(
    *,
    count: int = 1200,
    frames: int = 60,
    noise: float = 0.05,
    axis: float = 0.31,
    centre: tuple[float, float] = (0.8, -0.6),
    first_stop_deg: float = 0.0,
    second_stop_deg: float = 90.6,
    lean_deg: float = 0.0,
    harmonic: float = 0.0,
    flicker: float = 0.0,
    seed: int = 0,
) -> Turning:
    """Signals of ``count`` pixels; ``centre`` is the slide's axis in stripes from the image's middle.

    ``lean_deg``: slide's u axis off the image's x, so that depth, too, changes the phase at the first stop.
    """
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(0, SHAPE[0], count), rng.integers(0, SHAPE[1], count)
    x, y = 2 * columns / (SHAPE[1] - 1) - 1, 2 * rows / (SHAPE[0] - 1) - 1
    relief = rng.uniform(-2.0, 2.0, count)  # stripes: every pixel an island
    v = 0.5 * DOWN * y + relief - centre[1]
    lean = np.deg2rad(lean_deg)
    u = 0.5 * ACROSS * (x * (1 + 0.03 * y) + 0.01 * x**3) - centre[0] + np.tan(lean) * (v + centre[1])

    stops = np.deg2rad([first_stop_deg, second_stop_deg])
    share = np.linspace(0, 1, frames)
    share = share + 0.02 * np.sin(11 * share) * np.sin(np.pi * share)
    theta = stops[0] + share * (stops[1] - stops[0])
    turns = axis + np.outer(np.cos(theta), u) + np.outer(np.sin(theta), v)
    last = axis + np.cos(stops[1]) * u + np.sin(stops[1]) * v
    order = np.rint(last)
    background = rng.uniform(40, 120, count)
    modulation = background * rng.uniform(0.4, 0.9, count)
    wave = np.cos(TURN * turns) + harmonic * np.cos(2 * TURN * turns)
    wave += noise * rng.standard_normal(wave.shape)
    gain = 1 + flicker * rng.standard_normal(frames)
    # the first hold shows cos θ·u + sin θ·v: of it a polynomial takes up all but relief
    terms = polynomial_terms(rows, columns, SHAPE)
    seen = axis + np.cos(stops[0]) * u + np.sin(stops[0]) * v
    first_phase = np.linalg.lstsq(terms.T, seen, rcond=None)[0]
    first_phase[0] += 3  # any integer
    return Turning(
        RotationPixels(gain[:, None] * (background + modulation * wave), background, modulation, last - order),
        terms,
        first_phase,
        90 * share,
        order,
    )


def solved(scene: Turning, *, angle_error_deg: float = 1.5) -> RotationCode:
    n = len(scene.angle_deg)
    rough = scene.angle_deg + angle_error_deg * np.sin(np.linspace(0, 7, n))
    candidates = order_candidates(stripes_down=DOWN)
    start = blind_start(
        scene.pixels,
        angle_deg=rough,
        gain=scene.pixels.levels.mean(axis=1) / scene.pixels.background.mean(),
        first=scene.first_phase @ scene.terms,
        candidates=candidates,
        stripes_across=ACROSS,
    )
    return solve_rotation_code(
        scene.pixels, start, terms=scene.terms, first_phase=scene.first_phase, candidates=candidates
    )


def wrong_orders(scene: Turning, code: RotationCode) -> np.ndarray:
    """(pixel) against truth, with the code's own zero."""
    zero = zero_of_course(code.course)
    difference = code.search.order + zero.last_turns - scene.order
    common = np.rint(np.median(difference))
    assert abs(common) <= 1  # ψ0 is known modulo a turn only
    return np.asarray(difference != common)


CASES = {
    "plain": {},
    "axis at the image's rim": {"centre": (5.5, 4.0), "axis": 0.92},
    "first stop 2° off": {"first_stop_deg": 2.0, "second_stop_deg": 91.0},
    "baseline tilted by 3°": {"lean_deg": 3.0, "second_stop_deg": 89.0},
    "no pure cosine": {"harmonic": 0.2, "flicker": 0.03},
    "few frames": {"frames": 30},
}


@pytest.mark.parametrize("case", CASES)
def test_every_island_gets_its_order(case: str) -> None:
    scene = turning(**CASES[case])
    code = solved(scene)
    wrong = wrong_orders(scene, code)
    assert wrong.mean() < 0.002
    assert code.confident_share > 0.98
    zero = zero_of_course(code.course)
    assert zero.residual_turns < 0.02


def test_noise_half_as_strong_as_the_stripes() -> None:
    scene = turning(noise=0.5, count=2500)
    code = solved(scene)
    wrong = wrong_orders(scene, code)
    assert wrong.mean() < 0.005
    if wrong.any():  # what is wrong is known to be doubtful
        assert np.median(code.search.confidence[wrong]) < 0.5 * np.median(code.search.confidence[~wrong])


def test_confidence_of_pure_noise_is_low() -> None:
    scene = turning()
    code = solved(scene)
    rng = np.random.default_rng(5)
    levels = scene.pixels.background + scene.pixels.modulation * rng.standard_normal(scene.pixels.levels.shape)
    guessed = search_orders(
        scene.pixels._replace(levels=levels),
        first=code.first_phase @ scene.terms,
        course=code.course,
        candidates=code.candidates,
    )
    assert np.mean(guessed.confidence > 0.2) < 0.01
    assert np.percentile(code.search.confidence, 2) > 0.2


def test_course_is_found_from_the_frames() -> None:
    scene = turning(second_stop_deg=90.0)
    code = solved(scene, angle_error_deg=2.0)
    angle = np.rad2deg(np.arctan2(code.course.across, code.course.aligned))
    assert 0 < np.std(angle - scene.angle_deg) < 0.05


def test_search_against_the_slow_form() -> None:
    scene = turning(count=40, frames=30, noise=0.3)
    code = solved(turning(frames=30))
    c, p = code.course, scene.pixels
    first = code.first_phase @ scene.terms
    signal = np.clip(((p.levels - c.offset[:, None]) / c.gain[:, None] - p.background) / p.modulation, -1.6, 1.6)
    misfit = []
    for m in code.candidates:
        turns = c.piston[:, None] + np.outer(c.aligned, first) + np.outer(c.across, p.wrapped + m)
        misfit.append(((signal - c.swing[:, None] * np.cos(TURN * turns)) ** 2).sum(axis=0))
    fast = search_orders(p, first=first, course=c, candidates=code.candidates)
    slow = np.sort(misfit, axis=0)
    floor = 0.01 * np.sum(c.swing**2)
    np.testing.assert_array_equal(fast.order, code.candidates[np.argmin(misfit, axis=0)])
    expected = (slow[1] - slow[0]) / (slow[1] + slow[0] + 2 * floor)
    np.testing.assert_allclose(fast.confidence, expected, atol=2e-4)


@pytest.mark.parametrize(("first", "last", "axis", "lean"), [(0, 0, 0.4, 0.0), (3, -2, -0.3, 0.0), (-1, 4, 0.2, 0.05)])
def test_labels_of_both_stops_are_brought_together(first: int, last: int, axis: float, lean: float) -> None:
    angle = np.linspace(0, 91, 50)
    course = course_from_angles(angle, gain=np.ones(50), axis_turns=axis, first_turns=first)
    piston = course.piston + last * course.across + np.random.default_rng(1).normal(0, 0.01, 50)
    zero = zero_of_course(course._replace(piston=piston, across=course.across + lean * course.aligned))
    assert (zero.first_turns, zero.last_turns) == (first, last)
    assert zero.axis_turns == pytest.approx(axis, abs=0.03)
    assert 0.005 < zero.residual_turns < 0.02


def test_too_few_pixels_are_refused() -> None:
    scene = turning(count=60)
    with pytest.raises(ValueError, match="pixels"):
        solved(scene)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("islands", [False, True])
def test_first_phase_from_the_hold(sense: int, islands: bool) -> None:
    y, x = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    truth = sense * (0.37 + 6.0 * x + 0.3 * x * y + 0.25 * y + 0.05 * x**3)
    rng = np.random.default_rng(2)
    pattern = np.cos(TURN * truth) + 0.2 * rng.standard_normal(SHAPE)
    if islands:
        pattern *= (np.hypot(x + 0.5, y) < 0.25) | (np.hypot(x - 0.45, y - 0.3) < 0.3)
    found = first_phase_of_hold(pattern.astype(np.float32), sense=sense)
    rows, columns = np.nonzero(pattern)
    off = found @ polynomial_terms(rows, columns, SHAPE) - truth[rows, columns]
    off -= np.rint(np.median(off))
    assert np.percentile(np.abs(off), 95) < 0.03
    assert np.sign(found[EXPONENTS.index((1, 0))]) == sense


def test_first_phase_needs_light() -> None:
    with pytest.raises(ValueError, match="lit"):
        first_phase_of_hold(np.zeros(SHAPE, np.float32), sense=1)
