"""Findings over records and bytes: what is damaged, broken in its chain, no longer current, or of mixed versions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from rahas.errors import ExpeditionError
from rahas.provenance.changes import Change, changes, in_words
from rahas.provenance.code import known_definitions
from rahas.provenance.fingerprints import CodeBase
from rahas.provenance.integrity import output_faults, record_faults
from rahas.provenance.lineage import Key, Source, Step, Steps
from rahas.provenance.records import MADE, MAKING, WITHDRAWN

# Kinds of findings and what each means, in the order of a table.
KINDS: Mapping[str, str] = {
    "bytes": "an artifact is not what was written",
    "record": "a record is missing or altered",
    "raw": "a raw file is not the one that was read",
    "chain": "made from something else than lies there",
    "stale": "code, parameters, columns or libraries have changed since",
    "unfinished": "not made, or not made to its end",
    "lingering": "an artifact of a scan that should have none",
    "mixed": "one stage, made by different code or libraries over the expedition",
    "orphan": "nothing accounts for the file",
    "leftover": "left by a job that was killed",
    "row": "the log has no such row",
    "companion": "a companion, a stamp or a table of code is damaged; no number depends on it",
}


class Finding(NamedTuple):
    """One thing that is not as it should be."""

    kind: str
    """One of :data:`KINDS`."""
    scan: str
    stage: str
    artifact: str
    """Path from the expedition's folder."""
    part: str
    """File within a store, where one is to be named."""
    text: str
    changes: tuple[Change, ...] = ()


def step_findings(steps: Steps, keys: Collection[Key], *, results: Path, code: CodeBase) -> list[Finding]:
    """Check the steps of ``keys``: first files against records, then records against what is to be made now.

    What follows from a damaged step before it is not told again.
    """
    known = {digest: step.shown + name for step in steps.values() for name, digest in _outputs(step).items()}
    chosen = [key for key in steps if key in set(keys)]
    damage = {key: list(_damage(steps[key], known)) for key in chosen}
    damaged = {key: told for key, told in damage.items() if told}
    found: list[Finding] = []
    for key in chosen:
        found += damaged.get(key, [])
        if steps[key].recipe is not None and steps[key].record is not None:
            found += _outdated(steps[key], damaged, results, code)
    return found


def mixed_findings(steps: Steps, keys: Collection[Key], *, results: Path) -> list[Finding]:
    """Stages whose artifacts, over the scans of ``keys``, were not all made by the same code and libraries."""
    stages: dict[str, list[Step]] = defaultdict(list)
    for key in steps:
        if key in set(keys) and steps[key].made and steps[key].kept:
            stages[key[1]].append(steps[key])
    found = []
    for stage, group in stages.items():
        by_code, by_libraries = defaultdict(list), defaultdict(list)
        for step in group:
            assert step.made is not None
            by_code[step.made.recipe.code].append(step.key[0])
            versions = (f"{name} {version}" for name, version in sorted(step.made.recipe.libraries.items()))
            by_libraries[", ".join(versions)].append(step.key[0])
        if len(by_code) > 1:
            who = "; ".join(f"code {name[:8]}: {_names(scans)}" for name, scans in by_code.items())
            text = f"made by {len(by_code)} versions of the code ({who}){_difference(results, list(by_code))}"
            found.append(Finding("mixed", "", stage, "", "", text))
        if len(by_libraries) > 1:
            who = "; ".join(f"{versions}: {_names(scans)}" for versions, scans in by_libraries.items())
            found.append(Finding("mixed", "", stage, "", "", f"made with different libraries ({who})"))
    return found


def _damage(step: Step, known: Mapping[str, str]) -> Iterator[Finding]:
    """What the step's own files say."""
    scan, stage = step.key
    lying = [name for name in step.outputs if (step.folder / name).exists()]
    if step.record_path.exists() or (lying and step.kept is not False):
        for text in record_faults(step.record_path, stage):
            yield Finding("record", scan, stage, _record_name(step), "", text)
    if step.kept is False:
        for name in lying:
            text = "should not lie there: the scan was rejected, or is not processed"
            yield Finding("lingering", scan, stage, step.shown + name, "", text)
        return
    if step.kept and (unfinished := _unfinished(step, lying)):
        yield Finding("unfinished", scan, stage, step.shown + step.outputs[0], "", unfinished)
    elif step.made:
        for fault in output_faults(step.folder, step.made.outputs, known):
            yield Finding("bytes", scan, stage, step.shown + fault.artifact, fault.part, fault.text)


def _unfinished(step: Step, lying: list[str]) -> str:
    if step.record is None:
        return "" if lying or step.record_path.exists() else "is not made: its job has not run, or failed"
    if step.record.outcome == MAKING:
        return "is not made to its end: its job is running, or was killed"
    if step.record.outcome == WITHDRAWN:
        return "was taken away, and is to be made again"
    return "" if step.record.outcome == MADE else "is not made, and nothing says why"


def _outdated(step: Step, damaged: Mapping[Key, list[Finding]], results: Path, code: CodeBase) -> Iterator[Finding]:
    """How the recipe of the record differs from what the recipe would be now."""
    scan, stage = step.key
    assert step.record is not None
    assert step.recipe is not None
    artifact = step.shown + step.outputs[0]
    try:
        was, now = step.record.recipe, step.recipe()
    except (OSError, ValueError, KeyError, TypeError, ExpeditionError) as error:
        if not any(source.step in damaged for source in step.sources):
            yield Finding("chain", scan, stage, artifact, "", f"whether it is current cannot be told: {error}")
        return
    if was.key == now.key:
        return
    differences = changes(
        was, now, old_code=known_definitions(results, was.code), new_code=code.definitions(step.entry)
    )
    sources = {source.name: source for source in step.sources}
    rest = []
    for change in differences:
        source = sources.get(change.name) if change.kind == "input" else None
        if source is None:
            rest.append(change)
        elif _told_before(source, damaged):
            continue
        elif source.path is not None or source.step is None:
            text = f"{change.text}: not the one that was read"
            yield Finding("raw", scan, stage, source.path or artifact, "", text, (change,))
        else:
            yield Finding("chain", scan, stage, artifact, "", f"{change.text}: made from another one", (change,))
    if rest:
        yield Finding("stale", scan, stage, artifact, "", in_words(rest), tuple(rest))


def _told_before(source: Source, damaged: Mapping[Key, list[Finding]]) -> bool:
    """Whether that what was read is damaged has been told of the step that made it."""
    found = damaged.get(source.step, []) if source.step is not None else []
    return any(source.path in (None, finding.artifact) for finding in found)


def _difference(results: Path, prints: list[str]) -> str:
    tables = [known_definitions(results, name) for name in prints]
    if any(table is None for table in tables):
        return ""
    whole = [table for table in tables if table is not None]
    names = sorted({*whole[0]}.union(*whole[1:]))
    differing = [name for name in names if len({table.get(name) for table in whole}) > 1]
    return f"; they differ in {', '.join(differing[:5])}{' and others' if len(differing) > 5 else ''}"


def _names(scans: list[str]) -> str:
    return ", ".join(scans[:6]) + (f" and {len(scans) - 6} more" if len(scans) > 6 else "")


def _outputs(step: Step) -> Mapping[str, str]:
    return step.made.outputs if step.made else {}


def _record_name(step: Step) -> str:
    scan, stage = step.key
    return f"results/{scan}/provenance/{stage}.json"
