"""`make bench`: how long a capture takes from video to page, beside decoding the same video alone; peak memory of jobs.

Everything is measured in one run: a 15-s capture of 720 × 480 as FFV1, H.264 and MPEG-2, each processed by
`snakemake --cores 2` for that scan alone, its calibration done before; and one of four times the length, for memory.
Fails where a target is missed.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from tests.bench.captures import CALIBRATION, LONG, SHORT, Film, make_captures, write_log
from tests.bench.measure import Measurement, measured, processed
from tests.bench.table import missed, table


def main() -> int:
    """Run the bench; exit status 1 where a target is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--folder", type=Path, help="keep the captures there, or take those that are there")
    parser.add_argument("--only", choices=[film.scan_id for film in (*SHORT, LONG)], help="one film alone")
    parser.add_argument("--repeats", type=int, default=1, help="process each film so often; the median run counts")
    options = parser.parse_args()
    films = [film for film in (*SHORT, LONG) if options.only in (None, film.scan_id)]
    if options.folder is not None:
        options.folder.mkdir(parents=True, exist_ok=True)
        return _bench(options.folder.resolve(), films, options.repeats)
    with tempfile.TemporaryDirectory(prefix="rahas-bench-") as folder:
        return _bench(Path(folder).resolve(), films, options.repeats)


def _bench(root: Path, films: list[Film], repeats: int) -> int:
    _say(f"load of the machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    make_captures(root, films, _say)
    write_log(root, [CALIBRATION])
    _say("processing the calibration")
    processed(root)
    found: list[Measurement] = []
    for film in films:
        write_log(root, [CALIBRATION, film])
        runs = []
        for _ in range(repeats):
            _say(f"processing {film.title}")
            runs.append(measured(root, film))
        found.append(sorted(runs, key=lambda run: run.whole_s)[len(runs) // 2])
    print(table(found))
    failures = missed(found)
    for failure in failures:
        print(f"MISSED: {failure}")
    return 1 if failures else 0


def _say(what: str) -> None:
    print(f"bench: {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
