"""A job as Snakemake starts it: one process that brings a row up to date as far as asked for."""

from __future__ import annotations

from pathlib import Path

from rahas.provenance.companions import Clock
from rahas.provenance.records import MADE, Record, read_record
from rahas.stores.atomic import sweep
from rahas.stores.digests import digest_of_json, digest_of_path, digests_of_files
from rahas.stores.locks import only_writer
from rahas.tasks.expedition import Expedition
from rahas.tasks.make import Maker, Rejected, finish, say
from rahas.tasks.pipeline import JOBS, STAGES, Work
from rahas.tasks.plan import PAGE_ENTRY, VERDICT_ENTRY, Plan, write_stamp
from rahas.tasks.recipes import page_recipe, verdict_recipe


def run(expedition: Expedition, job_name: str, scan_id: str, stamp: Path) -> None:
    """Run job ``job_name`` for a row and write its stamp."""
    job = JOBS[job_name]
    work = Work(expedition, expedition.entry(scan_id))
    scan = work.scan
    lock = expedition.root / ".snakemake" / "rahas-locks" / f"{scan_id}.lock"
    with only_writer(lock, lambda: say(scan_id, "waiting for an earlier job of this scan to end")):
        for folder in (scan.path, scan.records, scan.capture_review.parent, scan.figures):
            sweep(folder)
        maker = Maker(work)
        problem, rejected = None, False
        if expedition.is_processed(work.entry):
            try:
                maker.make_job(job)
            except Rejected as rejection:
                maker.withdraw_after(rejection)
                problem, rejected = rejection.reason, True
        else:
            maker.withdraw(tuple(STAGES))
        if job.is_last or rejected:  # a scan on its way has no verdict yet
            _write_verdict(work, problem)
        if job.is_last:
            _write_page(work)
        write_stamp(stamp, Plan(expedition).recipe(job_name, scan_id))


def _write_verdict(work: Work, problem: object) -> None:
    from rahas.tasks import review  # where it is needed: a job's imports are part of its time

    clock = Clock()
    entry, scan = work.entry, work.scan
    review.write_verdict(
        scan,
        decision=entry.decision,
        role=entry.role,
        processed=work.expedition.is_processed(entry),
        overridden=entry.scan_id in work.expedition.include_rejected,
        problem=problem,
    )
    record = Record(verdict_recipe(work, problem), MADE, {scan.qa.name: digest_of_path(scan.qa)})
    record.write(scan.records / "verdict.json")
    finish(work, "verdict", VERDICT_ENTRY, record, clock)


def _write_page(work: Work) -> None:
    clock = Clock()
    scan, path = work.scan, work.scan.records / "page.json"
    recipe = page_recipe(work)
    former = read_record(path)
    if former is not None and former.recipe.key == recipe.key and _lies_there(scan.path, former):
        return
    from rahas.tasks import page

    page.run(scan, entry=work.entry, calibration=work.calibration)
    outputs = digests_of_files(scan.path, (scan.report, scan.figures))
    record = Record(recipe, MADE, outputs)
    record.write(path)
    finish(work, "page", PAGE_ENTRY, record, clock)
    say(work.entry.scan_id, f"page written, digest {digest_of_json(outputs)[:8]}")


def _lies_there(folder: Path, record: Record) -> bool:
    return all((folder / name).exists() for name in record.outputs)
