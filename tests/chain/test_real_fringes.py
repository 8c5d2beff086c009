"""Real camera frames of a plaster head under projected fringes (fringes_david in RAHAS_EXTRA_DATA).

How the phase stage is given a set of stills of which nothing is known but that stripes move between them: turn the
pictures so that stripes lie level and phase grows downwards, call :func:`rahas.stages.snakes.track` with a timeline
that is one hold at slide angle 90° (there is no rotation, so nothing is un-rotated), and hand the snakes of the first
picture and of all pictures to :func:`rahas.stages.phase.solve`. See :func:`solved`.

The camera's response is far from linear: the second harmonic of what a pixel sees is 9 to 20 % of the fundamental.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from rahas.kernels.phase_shifting import wrap
from rahas.params import PhaseParams, SnakesParams
from rahas.stages import phase, snakes
from rahas.typing import AnyArray, FloatArray

STEPS = 12
UNEVEN = (0, 1, 2, 4, 5, 7, 8, 11)
REPEATED = (0, 0, 0, 1, 2, 2, 4, 5, 7, 7, 8, 11, 11)


@pytest.fixture(scope="module")
def recordings(extra_data: Path) -> Path:
    for folder in (extra_data / "fringes_david", extra_data):
        if (folder / "period42_step00.png").is_file():
            return folder
    pytest.skip(f"{extra_data.name} holds no fringes_david")


def pictures(folder: Path, period: int) -> AnyArray:
    """(step, y, x), turned so that the phase runs down."""
    names = [str(folder / f"period{period}_step{n:02d}.png") for n in range(STEPS)]
    return np.stack([cv2.imread(name, cv2.IMREAD_GRAYSCALE).T for name in names])


def even_phase(frames: AnyArray) -> FloatArray:
    """φ of all twelve even steps: the reference, in which harmonics up to the tenth cancel."""
    angle = 2 * np.pi * np.arange(STEPS) / STEPS
    sine = np.tensordot(np.sin(angle), frames.astype(np.float64), axes=1)
    cosine = np.tensordot(np.cos(angle), frames.astype(np.float64), axes=1)
    return np.arctan2(-sine, cosine)


class Solved(NamedTuple):
    step_error: FloatArray
    """(frame,), radians."""
    phase_error: FloatArray
    """(measured pixel,), radians."""
    measured: float

    def __str__(self) -> str:
        size = 1e3 * np.abs(self.phase_error)
        return (
            f"steps within {1e3 * np.abs(self.step_error).max():.1f} mrad; phase: median {np.median(size):.1f}, "
            f"rms {1e3 * np.sqrt(np.mean(self.phase_error**2)):.1f}, 95 % {np.percentile(size, 95):.1f} mrad; "
            f"{self.measured:.3f} measured"
        )


def solved(frames: AnyArray, order: tuple[int, ...], params: PhaseParams | None = None) -> Solved:
    """The pictures ``order``, no step told: how many show the first one's position is what a hold would tell."""
    shown = frames[list(order)]
    count, still = len(order), order.count(order[0])
    timeline = snakes.SnakeTimeline(
        slide_angle_deg=np.full(count, 90.0),
        rotation_sense=1,
        first_hold=(0, 0),
        second_hold=(0, 0),
        moving=((0, count - 1),),
        lit=np.ones(count, bool),
    )
    blocks = list(snakes.track(shown, timeline, SnakesParams()).blocks)
    identity, y = np.concatenate([b.identity for b in blocks]), np.concatenate([b.y for b in blocks])
    result = phase.solve(
        shown,
        first=0,
        last=count - 1,
        held=still,
        fields=[slice(None)],
        snakes=phase.ScanSnakes(identity, y),
        first_order=0,
        params=params or PhaseParams(),
    )
    measured = np.isfinite(result.unwrapped_phase)
    return Solved(
        wrap(result.steps - 2 * np.pi * np.array(order) / STEPS),
        wrap(result.wrapped_phase - even_phase(frames))[measured],
        float(measured.mean()),
    )


@pytest.mark.parametrize("period", [42, 45, 48])
@pytest.mark.parametrize(("name", "order"), [("uneven", UNEVEN), ("repeated", REPEATED), ("even", tuple(range(STEPS)))])
def test_uneven_steps_agree_with_even_ones(recordings: Path, period: int, name: str, order: tuple[int, ...]) -> None:
    result = solved(pictures(recordings, period), order)
    print(f"period {period}, {name}: {result}")
    assert result.measured > 0.85
    assert np.abs(result.step_error).max() < 0.03
    assert 0.001 < np.median(np.abs(result.phase_error)) < (0.01 if name == "even" else 0.02)


def test_a_pure_cosine_would_be_several_times_worse(recordings: Path) -> None:
    """Snakes' own steps and no harmonics: the comparison can fail."""
    result = solved(pictures(recordings, 45), UNEVEN, PhaseParams(method="least_squares"))
    print(f"period 45, uneven, least squares: {result}")
    assert 0.025 < np.median(np.abs(result.phase_error)) < 0.1
