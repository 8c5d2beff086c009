"""The table and the error maps of `make accuracy`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from rahas.report.colours import Scale, coloured
from rahas.typing import AnyArray, ByteArray
from tests.accuracy.bench import Result, Rival
from tests.accuracy.cases import Case
from tests.accuracy.measures import Score

DOCS = Path(__file__).resolve().parents[2] / "docs"
TILE = (180, 120)  # px
REACH_MM = 0.2
HEAD = (
    "| case | method | phase rms / CRB | ripple 1–4, mrad | wrong orders | coverage | depth rms, mm | 1:N | "
    "\\|dZ\\|/σ 68 % | missed |\n|---|---|---|---|---|---|---|---|---|---|"
)
INTRODUCTION = """# Accuracy

Made by `make accuracy`: every case is rendered at full size and brought through the whole chain, with a calibration of
its own rig made by the same method. The captures stand in tests/accuracy/cases.py, the measures beside them.

- Phase rms / CRB: over the rms of the Cramér–Rao bound, the error that no estimator can beat, from the noise that the
  renderer put into the frames before compression. The bound counts the frames of the scan; the chain also uses those of
  the hold before it, so it can come out a little below 1.
- Ripple: amplitudes of the orders 1 to 4 of the phase error along the phase.
- Wrong orders: share of the measured pixels. Coverage: share of lit pixels more than 2 px from a depth edge.
- Depth rms: of Z over all of these, against the true surface, calibration errors included; 1:N of the field's diagonal.
- |dZ|/σ: 68th percentile of the depth error over its own stated standard deviation; 1 where σ is true.
- Missed: goals of the default mode that were not reached: phase ≤ 1.10 CRB (1.25 with gamma 2.2; none for compressed
  video, whose cost is reported), ripple ≤ 1 mrad, wrong orders ≤ 0.5 %, coverage ≥ 99 %, depth 1:5000.

"""
MAPS = """
Depth error of the default mode, −0.2 mm blue, 0 white, +0.2 mm red, hatched where nothing was measured or lit; the
cases of the table in order, row by row:

![Error maps](images/accuracy_error_maps.jpg)
"""


def lines(case: Case, result: Result) -> list[str]:
    """The table's lines of a case."""
    made = []
    for method, found in result.scores.items():
        if isinstance(found, str):
            made.append(f"| {case.name} | {method} | {found} | | | | | | | |")
            continue
        missed = ", ".join(_missed(case, found)) if method == "joint" else ""
        ripples = " ".join(f"{r:.1f}" for r in found.ripple_mrad)
        made.append(
            f"| {case.name} | {method} | {found.over_bound:.2f} | {ripples} | {found.wrong_orders:.4f} | "
            f"{found.coverage:.4f} | {found.depth_rms_mm:.3f} | 1:{_one_in(found):.0f} | {found.normalised_68:.2f} | "
            f"{missed} |"
        )
        if found.form:
            made.append(f"| | {method} | {found.form} | | | | | | | |")
    if result.rival is not None:
        made.append(_rival_line(result.rival, result.scores["joint"]))
    return made


def write(cases: list[Case], results: list[Result]) -> None:
    """Put table and error maps into docs/."""
    table = [line for case, result in zip(cases, results, strict=True) for line in lines(case, result)]
    (DOCS / "ACCURACY.md").write_text(INTRODUCTION + "\n".join([HEAD, *table]) + "\n" + MAPS, encoding="utf-8")
    tiles = [_tile(case.name, result.scores["joint"]) for case, result in zip(cases, results, strict=True)]
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % 5)
    sheet = np.vstack([np.hstack(tiles[i : i + 5]) for i in range(0, len(tiles), 5)])
    cv2.imwrite(str(DOCS / "images" / "accuracy_error_maps.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 80])


def _missed(case: Case, s: Score) -> list[str]:
    goals = case.goals
    return [
        name
        for name, missed in (
            ("phase", goals.over_bound is not None and s.over_bound > goals.over_bound),
            ("ripple", max(s.ripple_mrad) > goals.ripple_mrad),
            ("orders", s.wrong_orders > goals.wrong_orders),
            ("coverage", s.coverage < goals.coverage),
            ("depth", goals.one_in is not None and _one_in(s) < goals.one_in),
        )
        if missed
    ]


def _one_in(s: Score) -> float:
    return s.diagonal_mm / s.depth_rms_mm


def _rival_line(rival: Rival, own: Score | str) -> str:
    share = (
        "" if isinstance(own, str) else f": joint has {own.phase_rms_rad / rival.phase_rms_rad:.2f} of its (goal 0.8)"
    )
    return (
        f"| | ideal PMP, f, f/6, f/36, {rival.frames} frames | "
        f"phase rms {1e3 * rival.phase_rms_rad:.2f} mrad{share} | | "
        f"{rival.wrong_orders:.4f} | | | | | |"
    )


def _tile(name: str, found: Score | str) -> ByteArray:
    if isinstance(found, str):
        picture: AnyArray = np.full((TILE[1], TILE[0], 3), 255, np.uint8)
    else:
        error = cv2.resize(found.depth_error_mm.astype(np.float32), TILE, interpolation=cv2.INTER_NEAREST)
        picture = coloured(error, Scale(-REACH_MM, REACH_MM, "mm", "signed"))
    label = name.encode("ascii", "replace").decode()
    cv2.putText(picture, label, (4, TILE[1] - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 0), 1, cv2.LINE_AA)
    return picture
