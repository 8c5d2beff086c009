"""What has changed since earlier results were made, told in few lines, whatever the number of scans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rahas.provenance.code import keep_definitions
from rahas.provenance.fingerprints import CodeBase
from rahas.provenance.records import MADE, PROBLEM, WITHDRAWN, Recipe, Record
from rahas.stores.atomic import write_text
from rahas.tasks.announce import Now, Outdated
from rahas.tasks.expedition import open_expedition
from rahas.tasks.pipeline import STAGES, Work
from rahas.tasks.plan import Plan

ORDER = ("ingest", "snakes", "phase", "cloud")
ENTRY = "rahas.tasks.one:run"


@pytest.fixture
def code(tmp_path: Path) -> Path:
    write_text(
        tmp_path / "code" / "tasks" / "one.py",
        "def run(x):\n    return _helped(x)\n\n\ndef _helped(x):\n    return x\n",
    )
    return tmp_path / "code"


def record(stage: str, code: str = "c", **recipe: Any) -> Record:
    parts: dict[str, Any] = {"params": {"a": 1}, "libraries": {"numpy": "2.4.6"}} | recipe
    return Record(Recipe(stage=stage, inputs={}, columns={}, code=code, **parts), MADE)


def now(code: str = "c", **changed: Any) -> Now:
    return Now(**({"code": code, "params": {"a": 1}, "libraries": {"numpy": "2.4.6"}} | changed))


def test_one_line_a_change(tmp_path: Path, code: Path) -> None:
    outdated = Outdated(tmp_path, CodeBase(code))
    assert outdated.lines(ORDER) == []
    newer = now(libraries={"numpy": "2.4.7"})
    for scan_id in ("a", "b", "c"):
        for stage in ("phase", "ingest"):
            outdated.add(scan_id, ENTRY, record(stage), newer)
    outdated.add("a", ENTRY, record("cloud"), now(params={"a": 2}))
    *lines, closing = outdated.lines(ORDER)
    assert lines == [
        "library numpy: 2.4.6 → 2.4.7: ingest, phase of 3 scans no longer current",
        "parameter a: 1 → 2: cloud of 1 scan no longer current",
    ]
    assert "computed again" in closing


def test_the_edited_function_is_named(tmp_path: Path, code: Path) -> None:
    before = CodeBase(code)
    keep_definitions(tmp_path, before, ENTRY)
    write_text(code / "tasks" / "one.py", "def run(x):\n    return _helped(x)\n\n\ndef _helped(x):\n    return 2 * x\n")
    after = CodeBase(code)
    outdated = Outdated(tmp_path, after)
    outdated.add("a", ENTRY, record("phase", before.fingerprint(ENTRY)), now(after.fingerprint(ENTRY)))
    assert outdated.lines(ORDER)[:-1] == [
        "code: function _helped of rahas/tasks/one.py was edited: phase of 1 scan no longer current"
    ]


def test_code_of_which_nothing_was_kept_is_one_line(tmp_path: Path, code: Path) -> None:
    outdated = Outdated(tmp_path, CodeBase(code))
    for stage, was in (("ingest", "c1"), ("phase", "c2")):
        outdated.add("a", ENTRY, record(stage, was), now())
    assert outdated.lines(ORDER)[:-1] == ["the code changed: ingest, phase of 1 scan no longer current"]


def test_many_changes_are_cut_short(tmp_path: Path, code: Path) -> None:
    outdated = Outdated(tmp_path, CodeBase(code))
    outdated.add("a", ENTRY, record("phase"), now(params={f"p{n}": n for n in range(30)}))
    lines = outdated.lines(ORDER)
    assert len(lines) == 10
    assert "23 more changes" in lines[8]


@pytest.fixture
def expedition(tmp_path: Path) -> Path:
    """Twenty rows whose records tell of other versions of a library; no job has run to its end."""
    root = tmp_path / "expedition"
    rows = "".join(f"scan{n},Tara,,\n" for n in range(20))
    write_text(root / "field_log.csv", f"scan_id,site,notes,decision\n{rows}")
    opened = open_expedition(root)
    code = Plan(opened)._code
    for n, entry in enumerate(opened.entries):
        for name in ("ingest", "timeline"):
            stage = STAGES[name]
            libraries = dict.fromkeys(stage.libraries, "1.0")
            recipe = Recipe(name, {}, {}, stage.params(Work(opened, entry)), code[stage.entry], libraries)
            outcome = (MADE, PROBLEM, WITHDRAWN, MADE)[n % 4]
            Record(recipe, outcome).write(opened.scan(entry.scan_id).records / f"{name}.json")
    return root


def test_plan_announces_without_reading_twice(expedition: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import rahas.tasks.plan as module

    read: list[Path] = []
    original = module.read_record
    monkeypatch.setattr(module, "read_record", lambda path: (read.append(path), original(path))[1])
    plan = Plan(open_expedition(expedition))
    lines = plan.announcement()
    told = [line for line in lines if line.startswith("library scipy: 1.0 → ")]
    assert len(told) == 1
    assert told[0].endswith(": timeline of 15 scans no longer current")  # five were withdrawn
    plan.targets()
    for entry in plan.expedition.entries:
        for job in plan.jobs(entry):
            plan.inputs(job.name, entry.scan_id)
    assert len(read) == len(set(read))
