"""A job as Snakemake starts it: one process that brings a row up to date as far as asked for."""

from __future__ import annotations

from pathlib import Path

from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import MADE, Recipe, Record, library_versions, read_record
from rahas.stores.atomic import sweep
from rahas.stores.digests import digest_of_json, digest_of_path
from rahas.stores.locks import only_writer
from rahas.tasks.expedition import Expedition
from rahas.tasks.make import Maker, Rejected, say
from rahas.tasks.pipeline import JOBS, STAGES, Work
from rahas.tasks.plan import PAGE_ENTRY, VERDICT_ENTRY, Plan, row_of, templates_digest, write_stamp


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

    entry, scan = work.entry, work.scan
    review.write_verdict(
        scan,
        decision=entry.decision,
        role=entry.role,
        processed=work.expedition.is_processed(entry),
        overridden=entry.scan_id in work.expedition.include_rejected,
        problem=problem,
    )
    read = (scan.capture_review, scan.result_review, scan.calibration)
    recipe = Recipe(
        stage="verdict",
        inputs={p.name: digest_of_path(p) for p in read if p.exists()},
        columns={"decision": entry.decision, "role": entry.role},
        params={"included": entry.scan_id in work.expedition.include_rejected, "problem": problem},
        code=package_code().fingerprint(VERDICT_ENTRY),
        libraries={},
    )
    Record(recipe, MADE, {scan.qa.name: digest_of_path(scan.qa)}).write(scan.records / "verdict.json")


def _write_page(work: Work) -> None:
    scan, path = work.scan, work.scan.records / "page.json"
    read = [p for name in STAGES for p in STAGES[name].outputs(scan) if p.exists()]
    calibration = work.calibration
    recipe = Recipe(
        stage="page",
        inputs={
            **{str(p.relative_to(scan.path)): digest_of_path(p) for p in (*read, scan.qa)},
            "calibration": digest_of_path(calibration.calibration)
            if calibration is not None and calibration.calibration.exists()
            else "none",
        },
        columns=row_of(work.entry),
        params={"templates": templates_digest()},
        code=package_code().fingerprint(PAGE_ENTRY),
        libraries=library_versions("jinja2", "opencv-python-headless"),
    )
    former = read_record(path)
    if former is not None and former.recipe.key == recipe.key and scan.report.exists() and scan.figures.exists():
        return
    from rahas.tasks import page

    page.run(scan, entry=work.entry, calibration=calibration)
    outputs = {p.name: digest_of_path(p) for p in (scan.report, scan.figures) if p.exists()}
    Record(recipe, MADE, outputs).write(path)
    say(work.entry.scan_id, f"page written, digest {digest_of_json(outputs)[:8]}")
