"""`rahas audit`: do the bytes match the records, is the chain whole, is it current, and what depends on what."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

from rahas.errors import ExpeditionError
from rahas.provenance.audit import Finding, mixed_findings, step_findings
from rahas.provenance.fingerprints import package_code
from rahas.provenance.lineage import Key, Steps, ancestry, dependents
from rahas.provenance.strays import scan_strays, stray_findings
from rahas.provenance.telling import Tree, counts_line, lineage_tree, plain, table_lines, tree_lines
from rahas.report.words import deciding_findings, finding_line
from rahas.stores.atomic import read_json
from rahas.tasks.expedition import Expedition
from rahas.tasks.pipeline import STAGES
from rahas.tasks.steps import as_it_was_run, steps_of
from rahas.tasks.wanted import Wanted, wanted_of

CLEAN, FOUND = 0, 1


class Audit(NamedTuple):
    """What an audit found."""

    scans: int
    artifacts: int
    findings: list[Finding]
    verdicts: dict[str, dict[str, Any]]
    """Of the scans that were asked for, or of all that are not accepted: ``verdict`` and ``reasons`` in words."""
    lineage: list[Tree]
    dependents: dict[str, list[str]] | None
    """Artifacts by the thing that they depend on; None where that was not asked."""


def run(
    expedition: Expedition,
    asked: Sequence[str],
    *,
    as_json: bool = False,
    explain: bool = False,
    show_dependents: bool = False,
) -> int:
    """Audit all, or the scans, artifacts and raw files in ``asked`` with all they were made from; print; return status.

    Raises
    ------
    ExpeditionError
        Something was asked for that is neither a scan, nor an artifact, nor a raw file of a scan.
    """
    audit = audit_of(expedition, asked, explain=explain, show_dependents=show_dependents)
    if as_json:
        print(json.dumps(as_plain(audit), indent=1, ensure_ascii=False))
    else:
        print(*_lines(audit, asked), sep="\n")
    return FOUND if audit.findings else CLEAN


def audit_of(
    expedition: Expedition, asked: Sequence[str] = (), *, explain: bool = False, show_dependents: bool = False
) -> Audit:
    """As :func:`run`, without printing."""
    expedition = as_it_was_run(expedition)
    steps = steps_of(expedition)
    wanted = [wanted_of(expedition, steps, name) for name in asked]
    if show_dependents:
        if not wanted:
            raise ExpeditionError("--dependents: expected a scan, an artifact or a raw file to ask about")
        return Audit(len(expedition.entries), 0, [], {}, [], {w.name: _dependents(steps, w) for w in wanted})
    keys = ancestry(steps, [key for one in wanted for key in one.keys]) if asked else set(steps)
    findings = step_findings(steps, keys, results=expedition.results, code=package_code())
    findings += mixed_findings(steps, keys, results=expedition.results)
    if asked:
        for scan in dict.fromkeys(one.scan for one in wanted if one.scan is not None):
            findings += scan_strays(expedition.root, steps, scan)
    else:
        findings += stray_findings(expedition.root, steps, [entry.scan_id for entry in expedition.entries])
    scans = {scan for scan, _ in keys} & {entry.scan_id for entry in expedition.entries}
    artifacts = sum(len(steps[key].artifacts()) for key in keys if steps[key].kept)
    verdicts = _verdicts(expedition, [key[0] for one in wanted for key in one.keys] if asked else scans)
    lineage = _lineage(expedition, steps, wanted, findings) if explain else []
    return Audit(len(scans), artifacts, findings, verdicts, lineage, None)


def as_plain(audit: Audit) -> dict[str, Any]:
    """The audit as plain values, for scripts."""
    findings = [f._asdict() | {"changes": [change._asdict() for change in f.changes]} for f in audit.findings]
    plainly = {"clean": not findings, **audit._asdict(), "findings": findings}
    return plainly if audit.dependents is not None else {n: v for n, v in plainly.items() if n != "dependents"}


def _lines(audit: Audit, asked: Sequence[str]) -> list[str]:
    if audit.dependents is not None:
        return [
            line
            for name, made in audit.dependents.items()
            for line in (f"{name}: {len(made) or 'no'} artifacts depend on it", *(f"  {path}" for path in made))
        ]
    lines = [line for tree in audit.lineage for line in (plain(tree["about"]), *tree_lines(tree), "")]
    if asked:
        for scan_id, verdict in audit.verdicts.items():
            lines.append(plain(f"{scan_id}: {verdict['verdict'].replace('_', ' ')}"))
            lines += [plain(f"  {reason}") for reason in verdict["reasons"]]
    return [*lines, *table_lines(audit.findings), counts_line(audit.scans, audit.artifacts, audit.findings)]


def _dependents(steps: Steps, wanted: Wanted) -> list[str]:
    paths = [wanted.raw] if wanted.raw else []
    return [path for key in dependents(steps, wanted.keys, paths) for path in steps[key].artifacts()]


def _verdicts(expedition: Expedition, scans: Any) -> dict[str, dict[str, Any]]:
    found = {}
    for entry in expedition.entries:
        path = expedition.scan(entry.scan_id).qa
        if entry.scan_id not in scans or not path.is_file():
            continue
        try:
            qa = read_json(path)
            reasons = [f"{reason.get('rule', '')}: {finding_line(reason)}" for reason in deciding_findings(qa)]
            found[entry.scan_id] = {"verdict": qa["verdict"], "reasons": reasons}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):  # damaged; found by its digest
            continue
    return found


def _lineage(expedition: Expedition, steps: Steps, wanted: Sequence[Wanted], findings: Sequence[Finding]) -> list[Tree]:
    by_step: dict[Key, list[Finding]] = {}
    for finding in findings:
        by_step.setdefault((finding.scan, finding.stage), []).append(finding)
    defaults = type(expedition.config)().model_dump(mode="json")

    def default_of(key: Key) -> dict[str, Any]:
        stage = STAGES.get(key[1])
        return defaults[stage.section] if stage is not None and stage.section else {}

    trees = []
    for one in wanted:
        if one.raw is not None:
            raise ExpeditionError(f"--explain: {one.name} is a raw file: nothing was made before it")
        for key in one.shown_keys(steps):
            tree = lineage_tree(steps, key, default_of=default_of, findings=by_step)
            trees.append({**tree, "about": _about(expedition, key)})
    return trees


def _about(expedition: Expedition, key: Key) -> str:
    if key[0] not in {entry.scan_id for entry in expedition.entries}:
        return ""
    entry = expedition.entry(key[0])
    facts = (entry.subject, entry.site, f"{entry.date} {entry.time}".strip(), entry.operator and f"by {entry.operator}")
    return f"{entry.scan_id}: " + ", ".join(fact for fact in facts if fact)
