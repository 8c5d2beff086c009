"""`make accuracy`: every case, thesis mode beside the default, against truth, the Cramér–Rao bound and the goals.

    python -m tests.accuracy [NAME …] [--write] [--cores N]

With names (parts of them suffice) only those cases; ``--write`` puts table and error maps into docs/.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tests.accuracy.bench import METHODS, Result, calibrate, run
from tests.accuracy.cases import CASES
from tests.accuracy.page import HEAD, lines, write
from tests.chain.bench import write_target


def main() -> int:
    """Run the cases and print the table; 0 even where a goal is missed: the table says so."""
    parser = argparse.ArgumentParser(prog="python -m tests.accuracy")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--cores", type=int, default=2)
    options = parser.parse_args()
    cases = [c for c in CASES if not options.names or any(n in c.name for n in options.names)]
    print(HEAD, flush=True)
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as name, ProcessPoolExecutor(options.cores) as pool:
        folder = Path(name)
        target = write_target(folder / "config" / "target.csv")
        rigs = list(dict.fromkeys((method, case.calibration.model_dump_json()) for case in cases for method in METHODS))
        list(pool.map(partial(calibrate, folder, target), rigs))
        for case, result in zip(cases, pool.map(partial(run, folder), cases), strict=True):
            print("\n".join(lines(case, result)), flush=True)
            results.append(result)
    if options.write:
        write(cases, results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
