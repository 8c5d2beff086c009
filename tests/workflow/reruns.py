"""What each change makes run: declared once, asserted by the tests of this folder, shown in docs/RERUNS.md.

The expedition: ``cal`` (calibration), ``rock`` (accepted, uses ``cal``), ``far`` (rejected by the first gate).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from rahas.tasks.pipeline import STAGES
from tests.workflow.expedition import NOTHING, Run

ALL = "cal far rock"
RULES = ("capture", "phase", "calibrate", "surface", "summary")


@dataclass(frozen=True)
class Rerun:
    """One change and all that it makes run."""

    change: str
    """In words, for the page."""
    computed: Mapping[str, str] = field(default_factory=dict)
    """Stage → the rows for which it is computed, sorted and separated by blanks."""
    pages: str = ""
    """Rows whose page is written anew."""
    jobs: Mapping[str, int] = field(default_factory=dict)
    """Rule → number of jobs started, the summary among them; a job may find that there is nothing to compute."""

    def __post_init__(self) -> None:
        assert set(self.computed) <= set(STAGES), self.computed
        assert set(self.jobs) <= set(RULES), self.jobs


def _first_gate(**more: str) -> dict[str, str]:
    return {"review_capture": ALL, **more}


EVERY_CAPTURE = {"capture": 3, "phase": 3, "calibrate": 1, "surface": 2, "summary": 1}
FROM_CLOUD = {"cloud": "rock", "review_result": "rock"}
RERUNS: dict[str, Rerun] = {
    "nothing": Rerun("nothing: the same command again"),
    "lost .snakemake": Rerun("Snakemake's own folder `.snakemake` lost"),
    "touched": Rerun("every file touched, captures and results", jobs=EVERY_CAPTURE),
    "copied": Rerun(
        "a fresh clone: everything copied without its times, without `.snakemake`, the code at another place",
        jobs=EVERY_CAPTURE,
    ),
    "comments": Rerun("comments, docstrings and the format of every source file"),
    "note": Rerun("a note in the log edited", pages="rock", jobs={"surface": 1, "summary": 1}),
    "template": Rerun("the pages' templates", pages=ALL, jobs={"calibrate": 1, "surface": 2, "summary": 1}),
    "kernel, same bytes": Rerun(
        "a kernel of the cloud edited, without an effect on any number",
        {"cloud": "rock"},
        jobs={"surface": 2, "summary": 1},
    ),
    "kernel, other numbers": Rerun(
        "a kernel of the first review edited: other numbers",
        _first_gate(review_result="rock"),
        pages=ALL,
        jobs=EVERY_CAPTURE,
    ),
    "parameter": Rerun("a parameter of the cloud", FROM_CLOUD, pages="rock", jobs={"surface": 2, "summary": 1}),
    "parameter, lost .snakemake": Rerun(
        "the same, `.snakemake` lost as well", FROM_CLOUD, pages="rock", jobs={"surface": 2, "summary": 1}
    ),
    "limit without effect": Rerun(
        "a QA limit, no verdict changes", _first_gate(review_result="rock"), jobs=EVERY_CAPTURE
    ),
    "limit that rejects": Rerun(
        "a QA limit that now rejects `rock`: its snakes, phase and cloud are taken away",
        _first_gate(),
        pages="rock",
        jobs=EVERY_CAPTURE,
    ),
    "limit that lets through": Rerun(
        "the limit back: `rock` is processed again",
        _first_gate(snakes="rock", phase="rock", **FROM_CLOUD),
        pages="rock",
        jobs=EVERY_CAPTURE,
    ),
    "new row": Rerun(
        "a new row (`far2`) in the log",
        {"ingest": "far2", "timeline": "far2", "review_capture": "far2"},
        pages="far2",
        jobs={"capture": 1, "phase": 1, "surface": 1, "summary": 1},
    ),
    "removed row": Rerun("a row removed from the log", jobs={"summary": 1}),
    "capture replaced": Rerun(
        "the capture of `far` replaced",
        {"ingest": "far", "timeline": "far", "review_capture": "far"},
        pages="far",
        jobs={"capture": 1, "phase": 1, "surface": 1, "summary": 1},
    ),
    "capture, same frames": Rerun(
        "the capture of `rock` replaced by one of the same frames in another file",
        {"ingest": "rock"},
        jobs={"capture": 1, "phase": 1, "surface": 1, "summary": 1},
    ),
    "calibration's photo replaced": Rerun(
        "the texture photo of the calibration replaced",
        {"calibrate": "cal", **FROM_CLOUD},
        pages="cal rock",
        jobs={"calibrate": 1, "surface": 2, "summary": 1},
    ),
    "calibration's capture replaced": Rerun(
        "the capture of the calibration replaced",
        {
            **dict.fromkeys(("ingest", "timeline", "review_capture", "snakes", "calibrate"), "cal"),
            "phase": "cal rock",
            **FROM_CLOUD,
        },
        pages="cal rock",
        jobs={"capture": 1, "phase": 3, "calibrate": 1, "surface": 2, "summary": 1},
    ),
    "library": Rerun(
        "another version of a library (pillow), with the same results: announced first",
        {"ingest": ALL, "calibrate": "cal", "cloud": "rock"},
        jobs=EVERY_CAPTURE,
    ),
    "rejected by the operator": Rerun(
        "the operator's decision on `rock` set to reject: its numbers are taken away",
        pages="rock",
        jobs={"surface": 1, "summary": 1},
    ),
    "deleted artifacts": Rerun(
        "deleted: a store and a cloud of `rock`, the pictures of `far`, the index",
        {"phase": "rock", "cloud": "rock"},
        pages="far",
        jobs={"phase": 1, "surface": 2, "summary": 1},
    ),
}


def assert_runs(name: str, run: Run) -> None:
    """The run did what is declared under ``name``: all of it and nothing else."""
    declared = RERUNS[name]
    assert run.status == 0, run.output
    computed: dict[str, str] = {}
    for scan_id, stage in run.made:
        computed[stage] = f"{computed.get(stage, '')} {scan_id}".strip()
    assert computed == declared.computed, run.output
    assert " ".join(run.pages) == declared.pages, run.output
    assert dict(Counter(run.jobs)) == declared.jobs, run.output
    assert (NOTHING in run.output) == (not declared.jobs), run.output
