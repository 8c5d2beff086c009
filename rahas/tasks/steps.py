"""The steps of an expedition as its log, its records and the stage table have them: the graph that an audit walks."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from rahas.provenance.companions import read_companion
from rahas.provenance.lineage import Key, Source, Step
from rahas.provenance.records import MADE, MAKING, PROBLEM, Recipe, read_record
from rahas.stores.atomic import read_json
from rahas.stores.captures import SIMULATED
from rahas.stores.field_log import Entry
from rahas.tasks.expedition import Expedition
from rahas.tasks.make import Maker
from rahas.tasks.pipeline import GATES, STAGES, Stage, Work, last_job, stages_before, withdrawn_by
from rahas.tasks.plan import PAGE_ENTRY, SIMULATE_ENTRY, SUMMARY_ENTRY, VERDICT_ENTRY
from rahas.tasks.recipes import page_recipe, render_recipe, summary_recipe, verdict_recipe

SUMMARY: Key = ("expedition", "summary")


class Outlook(NamedTuple):
    """How far a row has come, by its records."""

    kept: dict[str, bool | None]
    """Of each stage of the row, whether its artifacts should lie there; None where that is open."""
    counts: Collection[str]
    """Stages whose records are a part of the present result."""
    problem: Any
    """Reason of the stage that could not go on, if one could not."""
    ended: bool
    """Nothing is missing before the verdict."""


def as_it_was_run(expedition: Expedition) -> Expedition:
    """The expedition with ``include_rejected`` as the verdicts' records have it: no file of the expedition says so."""
    records = {e.scan_id: read_record(expedition.scan(e.scan_id).records / "verdict.json") for e in expedition.entries}
    included = {scan_id for scan_id, record in records.items() if record and record.recipe.params.get("included")}
    return replace(expedition, include_rejected=expedition.include_rejected | included)


def steps_of(expedition: Expedition) -> dict[Key, Step]:
    """All steps, those of calibrations first, each after what it was made from."""
    entries = sorted(expedition.entries, key=lambda entry: entry.role != "calibration")
    steps = {step.key: step for entry in entries for step in _steps_of_row(expedition, entry)}
    if expedition.entries:
        steps[SUMMARY] = _summary_step(expedition)
    return steps


def outlook(work: Work) -> Outlook:
    """Walk a row's stages as a job would, by what the records say."""
    maker, names = Maker(work), last_job(work.entry).reaches()
    if not work.expedition.is_processed(work.entry):
        return Outlook(dict.fromkeys(names, False), set(), None, ended=True)
    for place, name in enumerate(names):
        record = maker.record(name)
        if record is None or record.outcome == MAKING:
            return _broken(names, place)
        if record.outcome == PROBLEM:
            return _stopped(names, name, record.reason)
        if name in GATES and record.outcome == MADE and not maker.is_let_through():
            try:
                reasons = read_json(GATES[name](work.scan))["reasons"]
            except (OSError, ValueError, KeyError, TypeError):
                return _broken(names, place)
            if reasons:
                return _stopped(names, name, None)
    return Outlook(dict.fromkeys(names, True), set(names), None, ended=True)


def _broken(names: list[str], place: int) -> Outlook:
    kept = {name: True if n <= place else None for n, name in enumerate(names)}
    return Outlook(kept, set(names[: place + 1]), None, ended=False)


def _stopped(names: list[str], at: str, problem: Any) -> Outlook:
    gone = {*withdrawn_by(at), *([at] if problem is not None else [])}
    counts = stages_before(at)
    return Outlook({name: name not in gone for name in names}, set(counts) & set(names), problem, ended=True)


def _steps_of_row(expedition: Expedition, entry: Entry) -> Iterator[Step]:
    work = Work(expedition, entry)
    seen = outlook(work)
    if entry.simulated:
        yield _render_step(work)
    for name, kept in seen.kept.items():
        yield _stage_step(work, STAGES[name], kept, counts=name in seen.counts)
    yield _verdict_step(work, seen)
    yield _page_step(work, seen)


def _stage_step(work: Work, stage: Stage, kept: bool | None, *, counts: bool) -> Step:
    sources = [Source(need, (work.scan.scan_id, need), None) for need in stage.needs]
    sources += [_raw(work, stage, name, path) for name, path in stage.files(work).items()]
    if stage.borrows and work.calibration is not None:
        sources.append(Source("calibration", (work.calibration.scan_id, stage.borrows), None))
    outputs = tuple(str(path.relative_to(work.scan.path)) for path in stage.outputs(work.scan))
    step = _step(work, stage.name, stage.entry, outputs, kept, tuple(sources))
    return replace(step, recipe=lambda: Maker(work).recipe(stage)) if counts else step


def _raw(work: Work, stage: Stage, name: str, path: Path | None) -> Source:
    """A raw file as the log names it now; where it names none, as it was named when it was read."""
    if path is None:
        record_path = work.scan.records / f"{stage.name}.json"
        made = read_companion(record_path, read_record(record_path)) or {}
        return Source(name, None, made.get("files", {}).get(name))
    rendered = path.is_relative_to(work.expedition.captures / SIMULATED)
    step = (work.scan.scan_id, "render") if rendered and work.entry.simulated else None
    return Source(name, step, str(path.relative_to(work.expedition.root)))


def _verdict_step(work: Work, seen: Outlook) -> Step:
    scan = work.scan
    makers = {scan.capture_review.name: "review_capture", scan.result_review.name: "review_result"}
    if work.entry.role == "calibration":
        makers = {scan.capture_review.name: "review_capture", scan.calibration.name: "calibrate"}
    sources = tuple(Source(name, (scan.scan_id, stage), None) for name, stage in makers.items())
    step = _step(work, "verdict", VERDICT_ENTRY, (scan.qa.name,), True if seen.ended else None, sources)
    return replace(step, recipe=lambda: verdict_recipe(work, seen.problem)) if seen.ended else step


def _page_step(work: Work, seen: Outlook) -> Step:
    scan = work.scan
    made = [(path, stage.name) for stage in STAGES.values() for path in stage.outputs(scan) if stage.name in seen.kept]
    sources = [Source(str(path.relative_to(scan.path)), (scan.scan_id, stage), None) for path, stage in made]
    sources.append(Source(scan.qa.name, (scan.scan_id, "verdict"), None))
    outputs = (scan.report.name, scan.figures.name)
    step = _step(work, "page", PAGE_ENTRY, outputs, True if seen.ended else None, tuple(sources))
    return replace(step, recipe=lambda: page_recipe(work)) if seen.ended else step


def _step(
    work: Work, stage: str, entry: str, outputs: tuple[str, ...], kept: bool | None, sources: tuple[Source, ...]
) -> Step:
    scan = work.scan
    path = scan.records / f"{stage}.json"
    shown = f"results/{scan.scan_id}/"
    return Step((scan.scan_id, stage), entry, scan.path, shown, path, read_record(path), outputs, kept, sources)


def _render_step(work: Work) -> Step:
    """The rendering of a simulated capture; of a row that is not processed none is asked for."""
    root, scan_id = work.expedition.root, work.entry.scan_id
    path = work.scan.records / "render.json"
    record = read_record(path)
    texture = work.expedition.captures / SIMULATED / f"{scan_id}_texture.png"
    asked = work.expedition.is_processed(work.entry) or path.exists()
    own = [p for p in (work.entry.capture, work.entry.texture or texture) if p is not None and asked]
    outputs = tuple(str(p.relative_to(root)) for p in own if p.is_relative_to(texture.parent))
    spec_path = root / "config" / "simulation.yaml"

    def recipe() -> Recipe:
        return render_recipe(spec_path, scan_id)

    book = Source("book", None, str(spec_path.relative_to(root)))
    step = Step((scan_id, "render"), SIMULATE_ENTRY, root, "", path, record, outputs, asked or None, (book,))
    return replace(step, recipe=recipe) if asked else step


def _summary_step(expedition: Expedition) -> Step:
    results = expedition.results
    path = results / "expedition" / "provenance" / "summary.json"
    sources = tuple(Source(e.scan_id, (e.scan_id, "verdict"), None) for e in expedition.entries)

    def recipe() -> Recipe:
        from rahas.tasks.summary import cards_of

        return summary_recipe(cards_of(results, expedition.entries))

    outputs = ("index.html", "scans.csv")
    return Step(SUMMARY, SUMMARY_ENTRY, results, "results/", path, read_record(path), outputs, True, sources, recipe)
