"""The expedition's provenance in standard form: an RO-Crate (Provenance Run Crate) and the same as a table."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from rahas import __version__
from rahas.errors import ExpeditionError
from rahas.provenance.action_table import action_table
from rahas.provenance.actions import Action, Artifact
from rahas.provenance.changes import flattened
from rahas.provenance.companions import read_companion
from rahas.provenance.crate import METADATA, Facts, crate_text
from rahas.provenance.lineage import Source, Step, Steps
from rahas.provenance.records import MADE, MAKING, Record
from rahas.stores.atomic import replacing, sweep_dead, write_text
from rahas.stores.digests import digest_of_bytes, digest_of_file
from rahas.tasks.expedition import Expedition
from rahas.tasks.make import digest_of_record
from rahas.tasks.pipeline import STAGES
from rahas.tasks.steps import as_it_was_run, steps_of

TABLE = "ro-crate-actions.csv"
WORKFLOW_COPY = "ro-crate-workflow.smk"
SNAKEFILE = Path(__file__).resolve().parents[2] / "Snakefile"
SETTINGS = ("field_log.csv", "config/config.yaml", "config/target.csv", "config/simulation.yaml")


class Exported(NamedTuple):
    """What was written."""

    crate: Path
    table: Path
    actions: int


def run(expedition: Expedition, output: Path | None = None) -> Exported:
    """Write ro-crate-metadata.json and ro-crate-actions.csv into ``output`` (the expedition's own folder).

    The expedition's folder is the default because a crate holds what lies below it: so the folder as it is, with
    captures and results, becomes the crate. The Snakefile is copied beside them where it lies elsewhere: a crate of a
    workflow has to hold its workflow.

    Raises
    ------
    ExpeditionError
        Nothing has been made yet, or the workflow's Snakefile is not where the program was installed from.
    """
    folder = (output or expedition.root).resolve()
    steps = steps_of(as_it_was_run(expedition))
    actions = [_action(expedition.root, step, steps) for step in steps.values() if _is_done(step)]
    if not actions:
        raise ExpeditionError("results: found no record of anything made, expected those of a run; run snakemake first")
    if not SNAKEFILE.is_file():
        raise ExpeditionError(f"{SNAKEFILE.name}: not found beside the program; export from a checkout of the project")
    sweep_dead(folder)
    table = action_table(actions)
    write_text(folder / TABLE, table)
    prefix = os.path.relpath(expedition.root, folder).replace(os.sep, "/")
    settings = [_now(expedition.root, name) for name in SETTINGS if (expedition.root / name).is_file()]
    own_table = Artifact(f"./{TABLE}", digest_of_bytes(table.encode()), size=len(table.encode()))
    facts = Facts(
        name=f"RAHAS expedition {_sites(expedition)}".rstrip(),
        description=f"{len(expedition.entries)} captures, the surfaces measured from them, and how each was made.",
        published=_published(actions, steps),
        version=__version__,
        engine=version("snakemake"),
        workflow=_workflow(expedition.root, folder),
        settings=settings,
        table=own_table,
        stages=("render", *STAGES, "verdict", "page", "summary"),
    )
    text = crate_text(facts, actions, prefix="" if prefix == "." else f"{prefix}/")
    write_text(folder / METADATA, text)
    return Exported(folder / METADATA, folder / TABLE, len(actions))


def _is_done(step: Step) -> bool:
    return step.record is not None and step.record.outcome != MAKING


def _action(root: Path, step: Step, steps: Steps) -> Action:
    record = step.record
    assert record is not None
    recipe, (scan_id, stage) = record.recipe, step.key
    columns: Mapping[str, Any] = recipe.columns if stage in STAGES else {}
    params = {name: value for name, value in recipe.params.items() if (stage, name) != ("summary", "order")}
    made = record.outputs if record.outcome == MADE else {}
    reason = record.reason or {}
    return Action(
        scan_id=scan_id,
        stage=stage,
        entry=step.entry,
        outcome=record.outcome,
        inputs=tuple(one for source in step.sources for one in _read(root, step, source, record, steps)),
        outputs=tuple(_artifact(root, step.shown + name, digest) for name, digest in made.items()),
        parameters={**flattened(params), **flattened(columns, "field_log.")},
        code=recipe.code,
        libraries=recipe.libraries,
        rahas=record.rahas,
        message=str(reason.get("message", "")),
        **_circumstances(step, record),
    )


def _read(root: Path, step: Step, source: Source, record: Record, steps: Steps) -> Iterator[Artifact]:
    """What of a source the step read, by the digests that its own record tells."""
    told = record.recipe.inputs.get(source.name)
    if told is None or told.startswith("none"):
        return
    digest = told.split(" ")[-1]
    maker = steps.get(source.step) if source.step else None
    if source.path is not None:
        yield _artifact(root, source.path, digest)
    elif maker is not None and maker.record is not None:
        of_record = step.key[1] in STAGES  # a stage's recipe names the record of a stage before it
        of_verdict = step.key[1] == "summary"  # the index names what it shows of a verdict
        outputs = maker.record.outputs
        for name, own in outputs.items():
            if of_record or of_verdict:
                same = of_verdict or digest == digest_of_record(maker.record)
                yield _artifact(root, maker.shown + name, own if same else digest)
            elif len(outputs) == 1 or source.name in (name, name.rpartition("/")[2]):
                yield _artifact(root, maker.shown + name, digest)


def _circumstances(step: Step, record: Record) -> dict[str, str | None]:
    """When, where and at which commit, as far as the record's companion tells."""
    told = read_companion(step.record_path, record)
    if told is None:
        return {}
    began = datetime.fromisoformat(told["began"])
    commit = told.get("commit")
    return {
        "began": began.isoformat(),
        "ended": (began + timedelta(seconds=told["seconds"])).isoformat(timespec="milliseconds"),
        "host": told.get("host"),
        "commit": f"{commit} (edited)" if commit and told.get("tree_clean") is False else commit,
    }


def _artifact(root: Path, path: str, digest: str) -> Artifact:
    place = root / path
    if place.is_dir():
        size = sum(file.stat().st_size for file in place.rglob("*") if file.is_file())
        return Artifact(path, digest, folder=True, size=size)
    if place.is_file():
        return Artifact(path, digest, size=place.stat().st_size)
    return Artifact(path, digest, folder=path.endswith(".zarr"))


def _now(root: Path, path: str) -> Artifact:
    return _artifact(root, path, digest_of_file(root / path))


def _workflow(root: Path, folder: Path) -> Artifact:
    if SNAKEFILE.is_relative_to(folder) and SNAKEFILE.is_relative_to(root):
        return _now(root, SNAKEFILE.relative_to(root).as_posix())
    with replacing(folder / WORKFLOW_COPY) as temporary:
        shutil.copyfile(SNAKEFILE, temporary)
    return _now(folder, WORKFLOW_COPY)._replace(path=f"./{WORKFLOW_COPY}")


def _published(actions: list[Action], steps: Steps) -> str:
    """The day on which the newest step ended; without companions, the day of the newest record."""
    ends = [action.ended[:10] for action in actions if action.ended]
    if ends:
        return max(ends)
    newest = max(step.record_path.stat().st_mtime for step in steps.values() if _is_done(step))
    return datetime.fromtimestamp(newest, UTC).date().isoformat()


def _sites(expedition: Expedition) -> str:
    return ", ".join(dict.fromkeys(entry.site for entry in expedition.entries if entry.site))
