"""docs/RERUNS.md from the declarations that the tests assert: ``python -m tests.workflow.rerun_table --write``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from rahas.tasks.pipeline import STAGES
from tests.workflow.reruns import RERUNS, RULES

PAGE = Path(__file__).parents[2] / "docs" / "RERUNS.md"
HEAD = """\
# What runs again after a change

Made by `python -m tests.workflow.rerun_table --write` from the declarations in `tests/workflow/reruns.py`; the tests of
that folder make each change on a processed expedition, run `snakemake --cores 2`, and assert that exactly this happens.

The expedition has three rows: `cal`, a calibration; `rock`, accepted, which uses `cal`; `far`, rejected by the first
gate. A job that is started compares digests first; what it then computes stands under *computed*. How this is decided:
[decision 1](decisions/0001-currency-by-records.md).
"""


def table() -> str:
    """The whole page."""
    columns = ["change", "jobs started", "stages computed", "pages written"]
    lines = [HEAD, "| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    for rerun in RERUNS.values():
        jobs = [f"{rerun.jobs[rule]} {rule}" for rule in RULES if rule in rerun.jobs]
        computed = [f"{stage} ({_listed(rerun.computed[stage])})" for stage in STAGES if stage in rerun.computed]
        cells = [rerun.change, ", ".join(jobs), ", ".join(computed), _listed(rerun.pages)]
        lines.append("| " + " | ".join(cell or "none" for cell in cells) + " |")
    return "\n".join([*lines, "", *_totals()]) + "\n"


def _totals() -> Iterator[str]:
    count = sum(1 for rerun in RERUNS.values() if not rerun.computed)
    yield f"Of these {len(RERUNS)} changes, {count} compute nothing."


def _listed(rows: str) -> str:
    return ", ".join(rows.split())


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        PAGE.write_text(table(), encoding="utf-8")
    else:
        print(table(), end="")
