"""Peak memory and CPU time of every job at several sizes of the image: what a cluster is asked for rests on them.

    python -m tests.bench.sizes

A scan and its calibration of 180 frames each, rendered and processed by `snakemake --cores 2`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from rahas.simulate.capture import stage
from rahas.simulate.examples import example
from rahas.stores.video_writer import Encoding, write_frames
from tests.bench.captures import CALIBRATION, SHORT, write_log, write_target
from tests.bench.measure import processed

SIZES = ((360, 240), (1280, 720), (1920, 1080))
SCAN = SHORT[0]


def main() -> None:
    """Print a line a job."""
    print("| image | job | peak, MB | CPU, s |\n|---|---|---:|---:|", flush=True)
    for width, height in SIZES:
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / "captures").mkdir()
            write_target(root)
            for film, kind in ((CALIBRATION, "roof"), (SCAN, "circle")):
                staged = stage(example(kind, short=True, seed=5, rig={"width_px": width, "height_px": height}))
                write_frames(root / "captures" / film.file, staged.frames(), Encoding(film.codec))
            write_log(root, [CALIBRATION, SCAN])
            jobs = processed(root).jobs
        for name in ("capture", "phase", "calibrate", "surface"):
            own = [job for job in jobs if job.name == name]
            peak, cpu = max(j.peak_mb for j in own), max(j.cpu_s for j in own)
            print(f"| {width} × {height} | {name} | {peak:.0f} | {cpu:.1f} |", flush=True)


if __name__ == "__main__":
    main()
