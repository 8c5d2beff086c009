"""`make accuracy`: every case, thesis mode beside the default, against truth and the Cramér–Rao bound.

    python -m tests.accuracy [NAME …] [--write]

With names (parts of them suffice) only those cases; ``--write`` puts the table into docs/ACCURACY.md.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from rahas.params import Config, PhaseParams
from rahas.simulate.capture import stage
from rahas.stores.layout import ScanFolder
from tests.accuracy.cases import CASES, Case
from tests.accuracy.competitor import measure
from tests.accuracy.measures import Score, score
from tests.chain.bench import film, process, write_target

METHODS = ("joint", "thesis")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "ACCURACY.md"
HEAD = (
    "| case | method | phase rms / CRB | ripple 1–4, mrad | wrong orders | coverage | depth rms, mm | 1:N | "
    "\\|dZ\\|/σ 68 % |\n|---|---|---|---|---|---|---|---|---|"
)


def main() -> int:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.accuracy")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    cases = [c for c in CASES if not options.names or any(n in c.name for n in options.names)]
    lines = [HEAD]
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as folder:
        bench = _Bench(Path(folder))
        for case in cases:
            for line in bench.run(case):
                print(line, flush=True)
                lines.append(line)
    if options.write:
        PAGE.write_text(_page(lines), encoding="utf-8")
    return 0


class _Bench:
    """Processes cases; a rig is calibrated once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._target = write_target(folder / "config" / "target.csv")
        self._calibrations: dict[str, ScanFolder] = {}

    def run(self, case: Case) -> list[str]:
        """The table's lines for a case."""
        captures = self._folder / "captures"
        captures.mkdir(exist_ok=True)
        path, truth = film(captures, "scan", case.scan)
        lines, notes = [], []
        for method in METHODS:
            scan = ScanFolder(self._folder / "results", f"scan_{method}")
            calibration = self._calibrated(case, method)
            config = Config(phase=PhaseParams(method=method))
            done = process(scan, path, calibration=calibration, config=config)
            if done.verdict == "accepted" or scan.cloud.exists():
                found = score(scan, case.scan, truth, case.asks)
                lines.append(_line(case.name, method, found))
                if found.form:
                    notes.append(f"| | {method} | {found.form} | | | | | | |")
            else:
                lines.append(f"| {case.name} | {method} | rejected: {done.verdict}: {done.why} | | | | | | |")
            shutil.rmtree(scan.path, ignore_errors=True)
        if case.name == "clean":
            notes.append(self._competitor(case, truth))
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
        return lines + notes

    def _calibrated(self, case: Case, method: str) -> ScanFolder:
        key = f"{method} {case.calibration.model_dump_json()}"
        if key not in self._calibrations:
            scan_id = f"cal_{len(self._calibrations)}"
            path, _ = film(self._folder / "captures", scan_id, case.calibration)
            scan = ScanFolder(self._folder / "results", scan_id)
            config = Config(phase=PhaseParams(method=method))
            done = process(scan, path, target=self._target, config=config)
            if done.verdict != "accepted":
                print(f"calibration of {case.name} ({method}): {done.verdict}: {done.why}", file=sys.stderr)
            path.unlink()
            shutil.rmtree(scan.frames, ignore_errors=True)
            self._calibrations[key] = scan
        return self._calibrations[key]

    def _competitor(self, case: Case, truth: dict[str, np.ndarray]) -> str:
        scan = [str(s) for s in truth["interval_stage"]].index("scan")
        frames = int(truth["interval_last"][scan] - truth["interval_first"][scan]) + 1
        found = measure(stage(case.scan), frames, truth["lit"])
        rms = float(np.sqrt(np.mean(found.phase_error[truth["lit"]] ** 2)))
        return (
            f"| | ideal PMP, f, f/6, f/36, {frames} frames | phase rms {1e3 * rms:.2f} mrad | | "
            f"{found.wrong_orders:.4f} | | | | |"
        )


def _line(name: str, method: str, s: Score) -> str:
    ripples = " ".join(f"{r:.1f}" for r in s.ripple_mrad)
    return (
        f"| {name} | {method} | {s.over_bound:.2f} | {ripples} | {s.wrong_orders:.4f} | {s.coverage:.4f} | "
        f"{s.depth_rms_mm:.3f} | 1:{s.diagonal_mm / s.depth_rms_mm:.0f} | {s.normalised_68:.2f} |"
    )


INTRODUCTION = """# Accuracy

Made by `make accuracy`: every case rendered at full size, brought through the whole chain with its own calibration, and
Made by `make accuracy`: every case rendered at full size and brought through the whole chain with its own
compression. 1:N is depth rms over the field's diagonal. Coverage counts lit pixels more than 2 px from a depth edge.
"""


def _page(lines: list[str]) -> str:
    return INTRODUCTION + "\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
