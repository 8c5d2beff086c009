"""What has to be run: each job of each row has a stamp, a file named after the key of its recipe.

A job's key is made of what can be known without computing: code fingerprints, parameters, library versions, the log's
columns, the state of the raw files and the keys of the jobs before it. Where the stamp of that name lies beside
complete artifacts, there is nothing to do. A job that is started compares digests before it computes anything, so a
touched file costs a moment and no computation. Nothing here depends on modification times of results or on
Snakemake's own metadata.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import MADE, MAKING, PROBLEM, Record, library_versions, read_record
from rahas.stores.atomic import write_json
from rahas.stores.capture_size import CaptureSize, size_of_capture, size_of_store
from rahas.stores.captures import SIMULATED
from rahas.stores.digests import digest_of_json, manifest_of_folder
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder
from rahas.stores.plain_yaml import PlainYamlError, parse_plain_yaml
from rahas.tasks.announce import Now, Outdated
from rahas.tasks.expedition import Expedition
from rahas.tasks.pipeline import JOBS, STAGES, Job, Work, last_job

PAGE_ENTRY = "rahas.tasks.page:run"
VERDICT_ENTRY = "rahas.tasks.review:write_verdict"
SIMULATE_ENTRY = "rahas.tasks.simulate:run"
SUMMARY_ENTRY = "rahas.tasks.summary:run"
SUMMARY_UNASKED = "results/expedition/provenance/summary.unasked.1"
"""Stamp of a summary that nobody asks for: its true name takes the keys of all rows."""
TEMPLATES = Path(__file__).resolve().parents[1] / "report" / "templates"


class Plan:
    """The stamps that a whole expedition should have."""

    def __init__(self, expedition: Expedition) -> None:
        self.expedition = expedition
        self._code = {
            entry: package_code().fingerprint(entry)
            for entry in (PAGE_ENTRY, VERDICT_ENTRY, SIMULATE_ENTRY, SUMMARY_ENTRY, *(s.entry for s in STAGES.values()))
        }
        self._keys: dict[tuple[str, str], str] = {}
        self._stamps: dict[tuple[str, str], str] = {}
        self._sizes: dict[str, CaptureSize | None] = {}
        self.outdated = Outdated(expedition.results, package_code())

    def jobs(self, entry: Entry) -> tuple[Job, ...]:
        """The jobs of a row, in order; a row that is not processed only gets its page."""
        last = last_job(entry)
        if not self.expedition.is_processed(entry):
            return (last,)
        return (JOBS["capture"], JOBS["phase"], last)

    def capture_size(self, scan_id: str) -> CaptureSize | None:
        """How large a row's capture is, as far as a look tells; ``None`` where it does not."""
        if scan_id not in self._sizes:
            entry, limit = self.expedition.entry(scan_id), self.expedition.config.ingest.max_megapixels
            stored = size_of_store(self.expedition.scan(scan_id).frames)
            self._sizes[scan_id] = stored or size_of_capture(entry.capture, max_pixels=round(limit * 1e6))
        return self._sizes[scan_id]

    def inputs(self, job_name: str, scan_id: str) -> list[str]:
        """Stamps that a job waits for."""
        entry = self.expedition.entry(scan_id)
        return [self.stamp(*before) for before in self._before(JOBS[job_name], entry)] + (
            [self.render_stamp(entry)] if job_name == "capture" and entry.simulated else []
        )

    def stamp(self, job_name: str, scan_id: str) -> str:
        """Path of the stamp, from the expedition's folder; found once, so a plan never changes its mind."""
        if (job_name, scan_id) not in self._stamps:
            job, entry = JOBS[job_name], self.expedition.entry(scan_id)
            stem = f"{job_name}.{self.key(job_name, scan_id)[:16]}"
            records = self._records(job, entry)
            name = self._name(stem, scan_id, self._is_whole(job, entry, records))
            if not (self.expedition.root / name).exists():
                self._note_outdated(entry, records)
            self._stamps[job_name, scan_id] = name
        return self._stamps[job_name, scan_id]

    def render_stamp(self, entry: Entry) -> str:
        """Stamp of the rendering of a simulated capture."""
        own = [path for path in (entry.capture, entry.texture) if path is not None and self._is_rendered(path)]
        record = read_record(self.expedition.scan(entry.scan_id).records / "render.json")
        recorded = record is not None and record.outcome == MADE
        whole = recorded and bool(own) and all(path.exists() for path in own)
        return self._name(f"render.{self._render_key(entry)[:16]}", entry.scan_id, whole)

    def to_render(self) -> list[str]:
        """Rows whose capture has to be rendered first."""
        rows = (entry for entry in self.expedition.entries if entry.simulated and self.expedition.is_processed(entry))
        return [entry.scan_id for entry in rows if not (self.expedition.root / self.render_stamp(entry)).exists()]

    def targets(self) -> list[str]:
        """The stamps that end every row."""
        return [self.stamp(last_job(entry).name, entry.scan_id) for entry in self.expedition.entries]

    def unfinished(self) -> set[str]:
        """Rows whose last job has not ended well with what is asked for now."""
        ends = zip(self.expedition.entries, self.targets(), strict=True)
        return {entry.scan_id for entry, stamp in ends if not (self.expedition.root / stamp).exists()}

    def summary_stamp(self) -> str:
        """Stamp of the expedition's index and table."""
        recipe = {
            "targets": self.targets(),
            "rows": [row_of(entry) for entry in self.expedition.entries],
            "code": [self._code[SUMMARY_ENTRY], templates_digest()],
        }
        folder = self.expedition.results / "expedition" / "provenance"
        made = (folder / "summary.json", self.expedition.results / "index.html", self.expedition.results / "scans.csv")
        whole = all(path.exists() for path in made)
        return self._name_in(folder, f"summary.{digest_of_json(recipe)[:16]}", whole)

    def key(self, job_name: str, scan_id: str) -> str:
        """Key of a job's recipe."""
        if (job_name, scan_id) not in self._keys:
            self._keys[job_name, scan_id] = digest_of_json(self.recipe(job_name, scan_id))
        return self._keys[job_name, scan_id]

    def recipe(self, job_name: str, scan_id: str) -> dict[str, Any]:
        """What the key is made of."""
        job, entry = JOBS[job_name], self.expedition.entry(scan_id)
        work = Work(self.expedition, entry)
        stages = job.stages() if self.expedition.is_processed(entry) else []
        files: dict[str, Any] = {}
        for stage in stages:
            files |= {name: self._state_of(entry, path) for name, path in stage.files(work).items()}
        recipe: dict[str, Any] = {
            "stages": {
                stage.name: {
                    "code": self._code[stage.entry],
                    "params": stage.params(work),
                    "columns": {column: getattr(entry, column) for column in stage.columns},
                    "libraries": library_versions(*stage.libraries),
                }
                for stage in stages
            },
            "files": files,
            "before": {":".join(before): self.key(*before) for before in self._before(job, entry)},
            "verdict": self._code[VERDICT_ENTRY],
            "included": entry.scan_id in self.expedition.include_rejected,
        }
        if job.is_last:
            recipe["page"] = [self._code[PAGE_ENTRY], templates_digest()]
            recipe["row"] = row_of(entry)
        return recipe

    def _before(self, job: Job, entry: Entry) -> list[tuple[str, str]]:
        if not self.expedition.is_processed(entry):
            return []
        before = [(name, entry.scan_id) for name in job.after]
        if entry.role == "scan" and entry.calibration is not None and job.after_calibration:
            calibration = self.expedition.entry(entry.calibration)
            processed = self.expedition.is_processed(calibration)  # else its only job takes its artifacts away
            names = job.after_calibration if processed else (last_job(calibration).name,)
            before += [(name, calibration.scan_id) for name in names]
        return before

    def announcement(self) -> list[str]:
        """What has changed since earlier results were made, a line a change; reads no record twice."""
        for entry in self.expedition.entries:
            for job in self.jobs(entry):
                self.stamp(job.name, entry.scan_id)
        return self.outdated.lines(STAGES)

    def _note_outdated(self, entry: Entry, records: Mapping[str, Record | None]) -> None:
        work = Work(self.expedition, entry)
        for name, record in records.items():
            stage = STAGES[name]
            now = Now(self._code[stage.entry], stage.params(work), library_versions(*stage.libraries))
            if record is not None and record.outcome in (MADE, PROBLEM) and not now.is_that_of(record.recipe):
                self.outdated.add(entry.scan_id, stage.entry, record, now)

    def _records(self, job: Job, entry: Entry) -> dict[str, Record | None]:
        """Records of the stages that the job may compute."""
        if not self.expedition.is_processed(entry):
            return {}
        folder = self.expedition.scan(entry.scan_id).records
        return {stage.name: read_record(folder / f"{stage.name}.json") for stage in job.stages()}

    def _is_whole(self, job: Job, entry: Entry, records: Mapping[str, Record | None]) -> bool:
        """Whether the artifacts that the job's records speak of lie there."""
        scan = self.expedition.scan(entry.scan_id)
        own = (scan.report, scan.figures, scan.qa, scan.records / "page.json", scan.records / "verdict.json")
        if job.is_last and not all(path.exists() for path in own):
            return False
        for name, record in records.items():
            stage = STAGES[name]
            if record is None:  # not made for a reason, or the record was lost
                if any(path.exists() for path in stage.outputs(scan)):
                    return False
            elif record.outcome == MAKING or (record.outcome == MADE and not stage.lies_there(scan)):
                return False
        return True

    def _name(self, stem: str, scan_id: str, whole: bool) -> str:
        """Stamp name: of the stamp that lies there if all is whole, else of one not made yet."""
        return self._name_in(self.expedition.scan(scan_id).records, stem, whole)

    def _name_in(self, folder: Path, stem: str, whole: bool) -> str:
        newest = max((int(p.suffix[1:]) for p in folder.glob(f"{stem}.*") if p.suffix[1:].isdigit()), default=0)
        number = newest if newest and whole else newest + 1
        return str((folder / f"{stem}.{number}").relative_to(self.expedition.root))

    def _render_key(self, entry: Entry) -> str:
        """Of the capture's own part of the simulation book: another capture's edit renders nothing anew."""
        try:
            capture = self._simulation_book["captures"][entry.scan_id]
            own = [capture, self._simulation_book["setups"][capture["setup"]]]
        except (KeyError, TypeError):  # said in words by the job that renders
            own = []
        return digest_of_json({"spec": repr(own), "scan": entry.scan_id, "code": self._code[SIMULATE_ENTRY]})

    def _state_of(self, entry: Entry, path: Path | None) -> Any:
        """What a look at a raw file tells; of one that is rendered first, what it is rendered from."""
        if entry.simulated and path is not None and self._is_rendered(path):
            return self._render_key(entry)
        return _state(path)

    def _is_rendered(self, path: Path) -> bool:
        return path.is_relative_to(self.expedition.captures / SIMULATED)

    @cached_property
    def _simulation_book(self) -> dict[str, Any]:
        path = self.expedition.root / "config" / "simulation.yaml"
        try:
            book, _ = parse_plain_yaml(path.read_bytes())
        except (OSError, PlainYamlError):  # said in words by the job that renders
            return {}
        return book if isinstance(book, dict) else {}


def row_of(entry: Entry) -> dict[str, Any]:
    """The log row as its page shows it."""
    return {
        **{
            name: getattr(entry, name)
            for name in (
                *("scan_id", "site", "notes", "decision", "role", "calibration"),
                *("subject", "date", "time", "operator", "redundant_of", "simulated"),
            )
        },
        "extra": dict(entry.extra),
    }


@lru_cache(maxsize=1)
def templates_digest() -> str:
    """Digest of the pages' templates: code that is no code."""
    return digest_of_json(manifest_of_folder(TEMPLATES))


def write_stamp(path: Path, recipe: Mapping[str, Any]) -> None:
    """Write a job's stamp and remove those of its former recipes."""
    job = path.name.split(".")[0]
    write_json(path, recipe)
    for former in path.parent.glob(f"{job}.*.*"):
        if former != path and former.suffix[1:].isdigit():  # not the record's companion, phase.made.json
            former.unlink()


def makes(scan: ScanFolder, artifact: str, entry: Entry) -> str | None:
    """Name of the job that makes ``artifact`` (a path below the scan's folder); ``None`` if none does."""
    wanted = scan.path / artifact
    if wanted in (scan.qa, scan.report):
        return last_job(entry).name
    chain = [JOBS["capture"], JOBS["phase"], last_job(entry)]
    for job in chain:
        if any(wanted in stage.outputs(scan) for stage in job.stages()):
            return job.name
    return None


def _state(path: Path | None) -> Any:
    """Size and time of a raw file (for a folder, of its files): what a look can tell."""
    if path is None:
        return None
    if not path.exists():
        return path.name
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    return [[p.name, p.stat().st_size, p.stat().st_mtime_ns] for p in files]
