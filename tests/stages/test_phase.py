"""The phase stage on small filmed slides: from frames and snakes to the phase of each pixel, against truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from rahas.errors import CaptureProblem
from rahas.kernels.phase_shifting import wrap
from rahas.params import PhaseParams
from rahas.stages.phase import PhaseResult, ScanSnakes, solve
from tests.kernels.fringes import STRIPES, tilted, uneven_crank

HEIGHT, WIDTH, COUNT, HELD, NOISE = 120, 160, 70, 6, 1.5


class Film(NamedTuple):
    frames: np.ndarray  # (frame, y, x) uint8
    phase: np.ndarray  # (y, x), radians, at the reference slide position
    snakes: ScanSnakes
    fields: list[slice]


def film(*, periods: float = 1.5, interlaced: bool = False) -> Film:
    """A relief under a tilting crank's pattern; interlaced frames are two moments, even rows first."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    v = 0.6 * (2 * y / (HEIGHT - 1) - 1) + 0.02 * np.sin(x / 21.0) + 0.03
    moments = uneven_crank(2 * COUNT, periods, 2 * HELD)
    phases = [np.pi * STRIPES * tilted(v, tilt) for tilt in moments]
    amplitude = 40 * (0.8 + 0.2 * np.sin(x / 19.0))
    frames = np.empty((COUNT, HEIGHT, WIDTH), np.uint8)
    for n in range(COUNT):
        shown = phases[2 * n].copy()
        if interlaced:
            shown[1::2] = phases[2 * n + 1][1::2]
        level = 1.5 * amplitude + amplitude * np.cos(shown) + rng.normal(0, NOISE, shown.shape)
        frames[n] = np.clip(np.rint(level), 0, 255)
    identities, rows = zip(*(_snakes(phases[2 * n]) for n in range(COUNT)), strict=True)
    snakes = ScanSnakes(np.stack(identities), np.stack(rows))
    return Film(frames, phases[0], snakes, [slice(0, None, 2), slice(1, None, 2)] if interlaced else [slice(None)])


def _snakes(phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Snake matrices (snake, x) of maxima at whole turns; snake 1 is turn −6."""
    turns = np.arange(-6, 8)
    rows = np.full((len(turns), WIDTH), np.nan, np.float32)
    for x in range(WIDTH):
        rows[:, x] = np.interp(2 * np.pi * turns, phase[:, x], np.arange(HEIGHT), left=np.nan, right=np.nan)
    identity = np.where(np.isfinite(rows), np.arange(1, len(turns) + 1)[:, None], 0).astype(np.int16)
    return identity, rows


def solved(what: Film, **params: object) -> PhaseResult:
    return solve(
        what.frames,
        first=0,
        last=COUNT - 1,
        held=HELD,
        fields=what.fields,
        snakes=what.snakes,
        first_order=-6,
        params=PhaseParams.model_validate(params),
    )


def _bound() -> float:
    return float(np.sqrt(2 / COUNT) * NOISE / 40)  # of even steps at the mean amplitude


@pytest.mark.parametrize("interlaced", [False, True], ids=["progressive", "interlaced"])
def test_joint_phase_reaches_the_noise(interlaced: bool) -> None:
    what = film(interlaced=interlaced)
    found = solved(what, method="joint")
    known = np.isfinite(found.unwrapped_phase)
    error = (found.unwrapped_phase - what.phase)[known]
    assert 0.9 < known.mean() <= 1.0
    assert np.abs(error).max() < 1.0  # no wrong order
    assert 0.8 * _bound() < np.std(error) < 1.5 * _bound()
    assert 0.8 < np.quantile(np.abs(error) / found.phase_std[known], 0.68) < 1.25
    assert 0.8 < np.median(found.chi2[known]) < 1.25


def test_each_method_is_better_than_the_one_before() -> None:
    what = film()
    spread = {}
    for method in ("thesis", "least_squares", "joint"):
        found = solved(what, method=method)
        known = np.isfinite(found.unwrapped_phase)
        error = wrap(found.unwrapped_phase - what.phase)[known]
        spread[method] = float(np.std(error))
        np.testing.assert_allclose(
            found.unwrapped_phase[known], found.wrapped_phase[known] + 2 * np.pi * found.fringe_order[known], atol=1e-4
        )
    assert spread["joint"] < 0.5 * spread["least_squares"]
    assert spread["joint"] < 0.5 * spread["thesis"]
    assert spread["thesis"] < 0.3


def test_thesis_blanks_rows_at_the_snakes() -> None:
    what = film()
    shares = [np.isfinite(solved(what, method="thesis", thesis_blanked_rows=n).unwrapped_phase).mean() for n in (0, 2)]
    assert 0.15 < shares[0] - shares[1] < 0.6


def test_steps_are_those_of_the_crank() -> None:
    what = film()
    found = solved(what, method="joint")
    v = what.phase[HEIGHT // 2, WIDTH // 2] / (np.pi * STRIPES)
    truth = np.pi * STRIPES * (tilted(v, uneven_crank(2 * COUNT, 1.5, 2 * HELD)[::2]) - v)
    assert 0 < np.std(found.steps - truth) < 0.03


def test_a_crank_that_hardly_moved_is_refused() -> None:
    with pytest.raises(CaptureProblem) as refused:
        solved(film(periods=0.6), method="thesis")
    assert refused.value.rule == "timeline"
    assert refused.value.value == pytest.approx(0.6, abs=0.1)
