"""Bring a scan's artifacts up to date: compute what is not current, withdraw what no longer holds."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from rahas.errors import CaptureProblem, ExpeditionError
from rahas.provenance.code import keep_definitions
from rahas.provenance.companions import Clock, write_companion
from rahas.provenance.fingerprints import package_code
from rahas.provenance.integrity import output_faults
from rahas.provenance.records import MADE, MAKING, PROBLEM, WITHDRAWN, Recipe, Record, library_versions, read_record
from rahas.stores.atomic import read_json, remove
from rahas.stores.digests import digest_of_json, digest_of_path
from rahas.tasks.memory import give_back_memory
from rahas.tasks.pipeline import GATES, STAGES, Job, Stage, Work, withdrawn_by


class Rejected(Exception):
    """The scan goes no further. ``reason`` is set where a stage found the problem, not a gate's limits."""

    def __init__(self, stage: str, reason: Mapping[str, Any] | None) -> None:
        super().__init__(stage)
        self.stage = stage
        self.reason = reason


class Maker:
    """Makes the stages of one row; everything that it decides, it decides by digests in the records."""

    def __init__(self, work: Work) -> None:
        self.work = work
        self.scan = work.scan
        self._done: set[tuple[str, bool]] = set()
        self._sound: set[tuple[str, str]] = set()  # (row, stage) whose bytes are known to be what the record says

    def make(self, name: str, *, files: bool = True) -> None:
        """See that stage ``name`` is current; with ``files``, that its artifacts lie there too.

        Raises
        ------
        Rejected
            The stage, or one before it, found that the capture cannot be used, or a gate said so.
        """
        files = files or name in GATES  # a gate's file is read here
        if (name, files) in self._done:
            return
        stage = STAGES[name]
        for need in (*stage.needs, *stage.gates):
            self.make(need, files=False)
        recipe = self.recipe(stage)
        record = self.record(name)
        if not (record is not None and record.recipe.key == recipe.key and self._holds(stage, record, files)):
            for need in stage.needs:
                self.make(need)
            self._see_inputs_whole(stage)
            self._compute(stage, recipe)
        if name in GATES and not self.is_let_through() and read_json(GATES[name](self.scan))["reasons"]:
            raise Rejected(name, None)
        self._done.add((name, files))

    def make_job(self, job: Job) -> None:
        """Make all of a job; the last one sees that everything a scan keeps lies there.

        Raises
        ------
        Rejected
            As :meth:`make`.
        """
        self.make(job.target, files=False)  # what a later gate took away is not made again to be taken away again
        if job.is_last or self.is_let_through():
            for name in job.reaches():
                self.make(name)

    def is_let_through(self) -> bool:
        """Whether the gates' limits are waived for this row, by ``include_rejected``."""
        return self.work.entry.scan_id in self.work.expedition.include_rejected

    def record(self, name: str) -> Record | None:
        return read_record(self._record_path(name))

    def recipe(self, stage: Stage) -> Recipe:
        """What decides the stage's output, as it stands now."""
        inputs = {need: digest_of_record(self.record(need)) for need in stage.needs}
        inputs |= {
            name: digest_of_path(path) if path is not None and path.exists() else f"none {path.name if path else ''}"
            for name, path in stage.files(self.work).items()
        }
        if stage.borrows and self.work.entry.role != "calibration":
            borrowed = self.work.lent(stage.borrows)
            inputs["calibration"] = f"{borrowed.outcome if borrowed else 'none'} {digest_of_record(borrowed)}"
        return Recipe(
            stage=stage.name,
            inputs=inputs,
            columns={column: getattr(self.work.entry, column) for column in stage.columns},
            params=stage.params(self.work),
            code=package_code().fingerprint(stage.entry),
            libraries=library_versions(*stage.libraries),
        )

    def withdraw(self, names: tuple[str, ...]) -> None:
        """Take artifacts away; their records stay and say so."""
        for name in names:
            record = self.record(name)
            if record is not None and record.outcome == MADE:
                Record(record.recipe, WITHDRAWN, record.outputs).write(self._record_path(name))
            for path in STAGES[name].outputs(self.scan):
                remove(path)

    def withdraw_after(self, rejection: Rejected) -> None:
        """Take away what a scan rejected there does not keep."""
        self.withdraw(withdrawn_by(rejection.stage))

    def _holds(self, stage: Stage, record: Record, files: bool) -> bool:
        if record.outcome == PROBLEM:
            raise Rejected(stage.name, record.reason)
        if record.outcome == WITHDRAWN:
            return not files
        return record.outcome == MADE and stage.lies_there(self.scan)

    def _see_inputs_whole(self, stage: Stage) -> None:
        """Compare the bytes that ``stage`` will read with their records; what was damaged since is made again.

        Raises
        ------
        ExpeditionError
            An artifact of the calibration, which is another row's to make, is damaged.
        """
        for need in stage.needs:
            if (damage := self._damage(self.work, need)) is None:
                continue
            say(self.work.entry.scan_id, f"{damage}: made again")
            for path in STAGES[need].outputs(self.scan):
                remove(path)
            self._compute_anew(STAGES[need])
        lent = self.work.lent(stage.borrows) if stage.borrows and self.work.entry.role != "calibration" else None
        if lent is not None and lent.outcome == MADE:
            owner = Work(self.work.expedition, self.work.expedition.entry(str(self.work.entry.calibration)))
            if damage := self._damage(owner, str(stage.borrows)):
                raise ExpeditionError(f"{damage}. Delete it and run the same command again: it is made again then.")

    def _compute_anew(self, stage: Stage) -> None:
        """Compute a stage whose artifacts were lost or damaged."""
        for need in stage.needs:
            self.make(need)
        self._see_inputs_whole(stage)
        self._compute(stage, self.recipe(stage))

    def _damage(self, work: Work, name: str) -> str | None:
        """What is wrong with the bytes of a stage's artifacts; ``None`` where they are what its record says."""
        record = read_record(work.scan.records / f"{name}.json")
        if (work.entry.scan_id, name) in self._sound or record is None or record.outcome != MADE:
            return None
        for fault in output_faults(work.scan.path, record.outputs, {}):
            artifact = (work.scan.path / fault.artifact).relative_to(work.expedition.root)
            return f"{artifact}: {fault.text}"
        self._sound.add((work.entry.scan_id, name))
        return None

    def _compute(self, stage: Stage, recipe: Recipe) -> None:
        clock = Clock()
        give_back_memory()
        record_path = self._record_path(stage.name)
        Record(recipe, MAKING).write(record_path)
        module, _, function = stage.entry.partition(":")
        try:
            arguments = stage.arguments(self.work)
            if stage.section:
                arguments["params"] = getattr(self.work.expedition.config, stage.section)
            getattr(import_module(module), function)(self.scan, **arguments)
        except CaptureProblem as problem:
            for path in stage.outputs(self.scan):
                remove(path)
            record = Record(recipe, PROBLEM, reason=problem.as_reason())
            record.write(record_path)
            finish(self.work, stage.name, stage.entry, record, clock)
            raise Rejected(stage.name, problem.as_reason()) from None
        outputs = {str(p.relative_to(self.scan.path)): digest_of_path(p) for p in stage.outputs(self.scan)}
        record = Record(recipe, MADE, outputs)
        record.write(record_path)
        finish(self.work, stage.name, stage.entry, record, clock)
        self._sound.add((self.work.entry.scan_id, stage.name))
        say(self.work.entry.scan_id, f"{stage.name} made in {clock.seconds:.1f} s")

    def _record_path(self, name: str) -> Path:
        return self.scan.records / f"{name}.json"


def say(scan_id: str, what: str) -> None:
    """One line of progress."""
    print(f"rahas: {scan_id}: {what}", file=sys.stderr, flush=True)


def finish(work: Work, stage: str, entry: str, record: Record, clock: Clock) -> None:
    """Leave what stands beside a record that has just been written: its companion, and the code of its fingerprint."""
    read = STAGES[stage].files(work) if stage in STAGES else {}
    files = {name: str(path.relative_to(work.expedition.root)) for name, path in read.items() if path is not None}
    write_companion(work.scan.records / f"{stage}.json", record, clock, notes=work.entry.notes, files=files)
    keep_definitions(work.expedition.results, package_code(), entry)


def digest_of_record(record: Record | None) -> str:
    if record is None:
        return "none"
    return digest_of_json({"outcome": record.outcome == PROBLEM, "outputs": record.outputs, "reason": record.reason})
