"""One case of `make accuracy`: filmed, calibrated with its own rig, brought through the chain with each method."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rahas.params import Config, PhaseParams
from rahas.simulate.capture import stage
from rahas.simulate.specs import CaptureSpec
from rahas.stores.digests import digest_of_bytes
from rahas.stores.layout import ScanFolder
from rahas.typing import AnyArray
from tests.accuracy.cases import Case
from tests.accuracy.competitor import Competitor, measure
from tests.accuracy.measures import Score, score
from tests.chain.bench import film, process

METHODS = ("joint", "thesis")
COMPARED = "clean"  # the case whose scene the competitor measures too


class Rival(NamedTuple):
    """The ideal phase measuring system on the same scene."""

    frames: int
    phase_rms_rad: float
    wrong_orders: float


class Result(NamedTuple):
    """What became of a case."""

    scores: dict[str, Score | str]  # by method; a text: why there is none
    rival: Rival | None


def calibrate(folder: Path, target: Path, rig: tuple[str, str]) -> None:
    """Film the target with a rig and calibrate it with a method; the scans of that rig find it in ``folder``."""
    method, capture = rig
    scan = _calibration(folder, method, capture)
    path, _ = film(_captures(folder, scan.scan_id), scan.scan_id, CaptureSpec.model_validate_json(capture))
    done = process(scan, path, target=target, config=Config(phase=PhaseParams(method=method)))
    if done.verdict != "accepted":
        print(f"calibration ({method}): {done.verdict}: {done.why}", file=sys.stderr)
    path.unlink()
    shutil.rmtree(scan.frames, ignore_errors=True)


def run(folder: Path, case: Case) -> Result:
    """A case with every method."""
    own = digest_of_bytes(case.name.encode())[:12]
    path, truth = film(_captures(folder, own), own, case.scan)
    scores: dict[str, Score | str] = {}
    for method in METHODS:
        scan = ScanFolder(folder / "results", f"{own}_{method}")
        calibration = _calibration(folder, method, case.calibration.model_dump_json())
        settings = case.settings.model_copy(update={"phase": case.settings.phase.model_copy(update={"method": method})})
        done = process(scan, path, calibration=calibration, config=settings)
        if done.verdict == "accepted" or scan.cloud.exists():
            scores[method] = score(scan, case.scan, truth, case.asks)
        else:
            scores[method] = f"rejected: {done.verdict}: {done.why}"
        shutil.rmtree(scan.path, ignore_errors=True)
    shutil.rmtree(path.parent)
    return Result(scores, _rival(case, truth) if case.name == COMPARED else None)


def _rival(case: Case, truth: dict[str, AnyArray]) -> Rival:
    scan = [str(s) for s in truth["interval_stage"]].index("scan")
    frames = int(truth["interval_last"][scan] - truth["interval_first"][scan]) + 1
    found: Competitor = measure(stage(case.scan), frames, truth["lit"])
    rms = float(np.sqrt(np.mean(found.phase_error[truth["lit"]] ** 2)))
    return Rival(frames, rms, found.wrong_orders)


def _calibration(folder: Path, method: str, capture: str) -> ScanFolder:
    return ScanFolder(folder / "results", f"cal_{digest_of_bytes(capture.encode())[:12]}_{method}")


def _captures(folder: Path, own: str) -> Path:
    captures = folder / "captures" / own
    captures.mkdir(parents=True, exist_ok=True)
    return captures
