"""Planning thousands of rows: work in proportion to the rows, counted in calls, which no busy machine changes."""

from __future__ import annotations

import cProfile
import pstats
from pathlib import Path

from rahas.tasks.expedition import open_expedition
from rahas.tasks.plan import Plan
from tests.workflow.expedition import write_log


def expedition_of(root: Path, sites: int) -> Path:
    """A calibration and four scans a site, their captures found by their stems, one with a photo."""
    (root / "captures").mkdir(parents=True)
    rows = []
    for site in range(sites):
        for n in range(5):
            scan_id = f"s{site}_{n}"
            role = "scan" if n else "calibration"
            rows.append({"scan_id": scan_id, "site": f"site {site}", "notes": "", "decision": "", "role": role})
            (root / "captures" / f"{scan_id}.mp4").write_bytes(b"no video")
        (root / "captures" / f"s{site}_1_texture.jpg").write_bytes(b"no photo")
    write_log(root, rows)
    return root


def calls_to_plan(root: Path) -> int:
    with cProfile.Profile() as profile:
        plan = Plan(open_expedition(root))
        targets = plan.targets()
        plan.summary_stamp()
    assert len(set(targets)) == len(plan.expedition.entries)
    assert all(entry.capture is not None for entry in plan.expedition.entries)
    return int(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]


def test_calls_grow_with_rows(tmp_path: Path) -> None:
    calls_to_plan(expedition_of(tmp_path / "first", 1))  # what is read once a process
    few = calls_to_plan(expedition_of(tmp_path / "few", 10))
    many = calls_to_plan(expedition_of(tmp_path / "many", 40))
    assert 3.0 < many / few < 4.4


def test_stamps_do_not_change_while_a_plan_lives(tmp_path: Path) -> None:
    """The scheduler knows files by the names that it was told at the start."""
    root = expedition_of(tmp_path / "one", 1)
    plan = Plan(open_expedition(root))
    before = plan.targets()
    for stamp in before:
        (root / stamp).parent.mkdir(parents=True)
        (root / stamp).write_text("{}")
    assert plan.targets() == before
    assert Plan(open_expedition(root)).targets() != before, "no artifacts lie beside these stamps"
