"""Run a stage on a made-up 1920 × 1080 capture; says what the stage adds to the process's peak memory, MB.

Run as a file, in a process of its own: ``memory_of_stage.py phase FOLDER`` or ``cloud``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HEIGHT, WIDTH, STRIPES, FRAMES, HELD = 1080, 1920, 30, 40, 4


def peak_mb() -> float:
    """Of this process so far, without the one that started it (which getrusage counts in)."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024


def phase_of_field() -> np.ndarray:
    """(y, x) radians, a gentle relief under stripes that lie across."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    return 2 * np.pi * (STRIPES * y / HEIGHT + 0.2 * np.sin(x / 90) - 3)


def film(folder: Path) -> None:
    """A scan of 1.2 periods as a frame store, written in a process of its own."""
    from rahas.stores.arrays import writing_store
    from rahas.stores.frames import GrowingArray, in_blocks

    phase = phase_of_field()
    noise = np.random.default_rng(3).normal(0, 1.5, phase.shape).astype(np.float32)
    steps = np.concatenate([np.zeros(HELD), np.linspace(0, 2.4 * np.pi, FRAMES - HELD)]).astype(np.float32)
    with writing_store(folder / "frames.zarr") as store, GrowingArray(store, "frames", ("frame", "y", "x")) as frames:
        for block in in_blocks(
            np.rint(110 + 60 * np.cos(phase + s) + np.roll(noise, 97 * n)).astype(np.uint8) for n, s in enumerate(steps)
        ):
            frames.append(block)


def snakes() -> tuple[np.ndarray, np.ndarray]:
    """Snake matrices (frame, snake, x) of the film."""
    phase = phase_of_field()
    steps = np.concatenate([np.zeros(HELD), np.linspace(0, 2.4 * np.pi, FRAMES - HELD)])
    turns = np.arange(-2, 26)
    rows = np.full((FRAMES, len(turns), WIDTH), np.nan, np.float32)
    for n, step in enumerate(steps):
        place = (turns[:, None] + 3 - step / (2 * np.pi) - 0.2 * np.sin(np.arange(WIDTH) / 90)) * HEIGHT / STRIPES
        rows[n] = np.where((place >= 0) & (place < HEIGHT), place, np.nan)
    assert phase.shape == (HEIGHT, WIDTH)
    return np.where(np.isfinite(rows), np.arange(1, len(turns) + 1)[:, None], 0).astype(np.int16), rows


def solve_phase(folder: Path) -> float:
    """Returns the share of pixels within 0.1 rad of truth."""
    from rahas.params import PhaseParams
    from rahas.stages.phase import ScanSnakes, solve
    from rahas.stores.arrays import open_store

    found = solve(
        open_store(folder / "frames.zarr")["frames"],
        first=0,
        last=FRAMES - 1,
        held=HELD,
        fields=[slice(None)],
        snakes=ScanSnakes(*snakes()),
        first_order=-2,
        params=PhaseParams(),
    )
    peak = peak_mb()
    right = np.abs(found.unwrapped_phase - phase_of_field()) < 0.1
    print(peak)
    return float(right.mean())


def make_cloud(folder: Path) -> float:
    """Returns the share of pixels that became points."""
    from rahas.params import CloudParams
    from rahas.stages.cloud import make_cloud
    from rahas.stages.rig import ImagingCamera, Rig
    from rahas.stores.ply import write_cloud
    from tests.roof_scene import camera_at, projector_above

    camera = ImagingCamera(camera_at(width=WIDTH, height=HEIGHT), WIDTH, HEIGHT)
    rig = Rig(camera, projector_above(), camera, np.zeros((20, 20)))
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    phase = 2 * np.pi * (9.0 + 14.0 * y / HEIGHT + 0.05 * np.sin(x / 90))
    del y, x
    cloud = make_cloud(
        unwrapped_phase=phase + np.float32(0.05) * np.cos(phase),
        phase_std=np.full(phase.shape, 0.02, np.float32),
        background=np.full(phase.shape, 100.0, np.float32),
        rig=rig,
        photo=np.full((HEIGHT, WIDTH, 3), 90, np.uint8),
        params=CloudParams(),
    )
    write_cloud(
        folder / "cloud.ply",
        cloud.points,
        mask=np.isfinite(cloud.points[..., 0]),
        normals=cloud.normals,
        colour=cloud.colour,
        scalars={"z_std": cloud.z_std},
    )
    print(peak_mb())
    return cloud.measured_share


if __name__ == "__main__":
    stage, place = sys.argv[1], Path(sys.argv[2])
    if stage == "film":
        film(place)
    else:
        print((solve_phase if stage == "phase" else make_cloud)(place))
