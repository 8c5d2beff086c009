"""The joint solve reaches the noise bound where one step a frame does not."""

from __future__ import annotations

import numpy as np
import pytest

from rahas.kernels.joint_steps import solve_joint_steps
from rahas.kernels.phase_field import solve_phase_field
from rahas.kernels.phase_shifting import HarmonicSums, weights_of_least_squares, wrap
from rahas.kernels.sampling import evenly_spread
from tests.kernels.fringes import Fringes, render


def _bound(fringes: Fringes, where: np.ndarray) -> float:
    """Root mean square of the Cramér–Rao bound of φ, radians."""
    rows, columns = where
    delta = fringes.delta[:, rows, columns]
    t = fringes.phase[rows, columns] + delta
    columns_of = np.stack([np.ones_like(t), np.cos(t), -fringes.amplitude[rows, columns] * np.sin(t)], axis=-1)
    information = np.einsum("npi,npj->pij", columns_of, columns_of) / fringes.noise**2
    return float(np.sqrt(np.linalg.inv(information)[:, 2, 2].mean()))


def _solve(fringes: Fringes, start_error: float = 0.15) -> tuple[np.ndarray, np.ndarray]:
    """Joint solution and the one-step solution of the same frames; phase errors (y, x)."""
    rng = np.random.default_rng(1)
    steps = np.median(fringes.delta.reshape(len(fringes.delta), -1), axis=1)
    weights = weights_of_least_squares(steps)
    sums = HarmonicSums(fringes.phase.shape, steps, weights)
    sums.add(fringes.frames)
    plain = sums.maps().wrapped_phase
    rough = fringes.phase + wrap(plain - fringes.phase)
    chosen = evenly_spread(np.ones(fringes.phase.shape, bool), 1500)
    field = solve_joint_steps(
        fringes.frames[:, chosen[0], chosen[1]],
        rough[chosen],
        steps + start_error * rng.standard_normal(len(steps)),
        np.arange(len(steps)) < fringes.held,
    )
    blocks = [fringes.frames[i : i + 32] for i in range(0, len(fringes.frames), 32)]
    maps = solve_phase_field(lambda: iter(blocks), rough.astype(np.float32), field)
    return wrap(maps.wrapped_phase - fringes.phase), wrap(plain - fringes.phase)


@pytest.mark.parametrize(("periods", "flicker"), [(1.0, 0.0), (1.6, 0.0), (2.3, 0.0), (1.6, 0.02)])
def test_reaches_the_bound(periods: float, flicker: float) -> None:
    fringes = render(periods=periods, flicker=flicker)
    joint, plain = _solve(fringes)
    everywhere = np.nonzero(np.ones(fringes.phase.shape, bool))
    bound = _bound(fringes, everywhere)
    ratio = np.sqrt(np.mean(joint**2)) / bound
    assert 0.9 < ratio < 1.15
    assert np.std(plain) / bound > 2.5  # what the tilt costs when a frame has one step


def test_no_ripple_at_any_order() -> None:
    fringes = render(second_harmonic=0.12, noise=1.0)
    joint, _ = _solve(fringes)
    for order in (1, 2, 3, 4):
        ripple = 2 * abs(np.mean(joint * np.exp(-1j * order * fringes.phase)))
        assert ripple < 2e-3, f"order {order}: {1e3 * ripple:.2f} mrad"


def test_pixels_that_lose_the_light_keep_their_phase() -> None:
    fringes = render(periods=2.0)
    frames = fringes.frames.copy()
    leaving = np.zeros(fringes.phase.shape, bool)
    leaving[:, :12] = True
    frames[68:][:, leaving] = 3
    joint, _ = _solve(fringes._replace(frames=frames))
    assert np.std(joint[leaving]) < 3 * np.std(joint[~leaving])
    assert abs(np.median(joint[leaving])) < 5e-3


def test_result_does_not_depend_on_blocks() -> None:
    fringes = render(shape=(40, 60))
    steps = np.median(fringes.delta.reshape(len(fringes.delta), -1), axis=1)
    field = solve_joint_steps(
        fringes.frames.reshape(len(steps), -1), fringes.phase.reshape(-1), steps, np.arange(len(steps)) < 6
    )
    rough = fringes.phase.astype(np.float32)
    whole = solve_phase_field(lambda: iter([fringes.frames]), rough, field)
    parts = [fringes.frames[i : i + 7] for i in range(0, len(steps), 7)]
    split = solve_phase_field(lambda: iter(parts), rough, field)
    for one, other in zip(whole, split, strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-4, atol=2e-4)


def test_too_few_pixels_are_refused() -> None:
    with pytest.raises(ValueError, match="pixels"):
        solve_joint_steps(np.zeros((20, 10)), np.zeros(10), np.zeros(20), np.arange(20) < 2)
