"""Findings as a table, lineages as trees: what the audit prints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from rahas.provenance.audit import KINDS, Finding
from rahas.provenance.changes import shortened, shown_digest
from rahas.provenance.companions import read_companion
from rahas.provenance.lineage import Key, Source, Step, Steps

Tree = dict[str, Any]
"""``name``, ``facts`` (lines below it) and ``from`` (trees); ``above`` where it has been drawn already."""


_OF_MANY = ("stale", "chain", "unfinished")  # kinds that concern scans alike


def table_lines(findings: Sequence[Finding]) -> list[str]:
    """Kind, artifact, what is wrong, in the order of :data:`KINDS`; what has changed for many scans is one line."""
    order = list(KINDS)
    alike: dict[tuple[int, str, str, str], list[Finding]] = {}
    for finding in sorted(findings, key=lambda f: (order.index(f.kind), f.scan, f.artifact, f.part)):
        end = finding.artifact
        end = end.removeprefix(f"results/{finding.scan}/") if finding.kind in _OF_MANY else f"{end}/{finding.part}"
        alike.setdefault((order.index(finding.kind), finding.stage, end, finding.text), []).append(finding)
    rows = [(group[0].kind, _place(group), group[0].text) for group in alike.values()]
    wide_kind, wide = (max((len(row[n]) for row in rows), default=0) for n in (0, 1))
    return [plain(f"{kind:<{wide_kind}}  {place:<{min(wide, 60)}}  {text}") for kind, place, text in rows]


def _place(group: Sequence[Finding]) -> str:
    first = group[0]
    if len(group) == 1:
        return first.artifact or f"stage {first.stage}"
    end = first.artifact.removeprefix(f"results/{first.scan}/")
    return f"{end} of {len(group)} scans ({shortened(', '.join(f.scan for f in group), 30)})"


def counts_line(scans: int, artifacts: int, findings: Sequence[Finding]) -> str:
    """``12 scans, 96 artifacts, 2 findings (1 bytes, 1 stale)``."""
    kinds = Counter(finding.kind for finding in findings)
    by_kind = ", ".join(f"{kinds[kind]} {kind}" for kind in KINDS if kinds[kind])
    total = f"{len(findings)} finding{'' if len(findings) == 1 else 's'}"
    return f"{scans} scan{'' if scans == 1 else 's'}, {artifacts} artifacts, {total}" + (
        f" ({by_kind})" if by_kind else ""
    )


def lineage_tree(
    steps: Steps,
    key: Key,
    *,
    default_of: Callable[[Key], Mapping[str, Any]],
    findings: Mapping[Key, Sequence[Finding]],
    drawn: set[Key] | None = None,
) -> Tree:
    """What a step was made from, down to raw files; a step that comes twice is drawn once."""
    drawn = set() if drawn is None else drawn
    step = steps[key]
    tree: Tree = {"name": _title(step), "stage": key[1], "scan": key[0]}
    if key in drawn:
        return tree | {"above": True}
    drawn.add(key)
    tree["facts"] = [*_facts(step, default_of(key)), *(f"! {f.kind}: {f.text}" for f in findings.get(key, []))]
    tree["from"] = []
    for source in step.sources:
        branch: Tree | None = None
        if source.path is not None:
            branch = {"name": source.path + _digest(step, source), "facts": [], "from": []}
            tree["from"].append(branch)
        if source.step is None or source.step not in steps:
            continue
        if branch is not None or source.name in _inputs(step):
            below = lineage_tree(steps, source.step, default_of=default_of, findings=findings, drawn=drawn)
            (branch["from"] if branch else tree["from"]).append(below)
    return tree


def tree_lines(tree: Tree, *, indent: str = "") -> Iterator[str]:
    """The tree as text."""
    if not indent:
        yield plain(tree["name"])
    below = [*(("", fact) for fact in tree.get("facts", [])), *((b, "") for b in tree.get("from", []))]
    branches = tree.get("from", [])
    for branch, fact in below:
        if not branch:
            yield plain(f"{indent}{'│  ' if branches else '   '}{fact}")
            continue
        last = branch is branches[-1]
        above = " (drawn above)" if branch.get("above") else ""
        yield plain(f"{indent}{'└─ ' if last else '├─ '}{branch['name']}{above}")
        yield from tree_lines(branch, indent=indent + ("   " if last else "│  "))


def plain(text: str) -> str:
    """One line without control characters: what is in a file's name must not steer a terminal."""
    return "".join(c if c.isprintable() else "?" for c in text).rstrip()


def _title(step: Step) -> str:
    artifacts = step.artifacts()
    what = ", ".join(artifacts) if artifacts else f"{step.key[0]}: nothing"
    return f"{what}  ← {step.key[1]}"


def _facts(step: Step, defaults: Mapping[str, Any]) -> Iterator[str]:
    record = step.record
    if record is None:
        yield "no record"
        return
    outcome = "" if record.outcome == "made" else f"{record.outcome}; "
    yield f"{outcome}code {record.recipe.code[:8]}, rahas {record.rahas}, " + ", ".join(
        f"{name} {version}" for name, version in sorted(record.recipe.libraries.items())
    )
    if record.reason:
        yield f"because: {record.reason.get('message', '')}"
    yield from _made_when(step)
    own = {n: v for n, v in record.recipe.params.items() if n in defaults and defaults[n] != v}
    if own:
        yield "not the default: " + ", ".join(f"{name} = {value}" for name, value in own.items())


def _made_when(step: Step) -> Iterator[str]:
    made = read_companion(step.record_path, step.record)
    if made is None:
        yield "when and where is not known (no companion)"
        return
    tree = {True: "clean", False: "with edits that are not committed", None: "state of the tree unknown"}
    commit = (
        f"commit {made['commit'][:8]} ({tree[made.get('tree_clean')]})" if made.get("commit") else "no commit known"
    )
    yield f"{made.get('began')}, {made.get('seconds')} s on {made.get('host')}, Python {made.get('python')}, {commit}"


def _inputs(step: Step) -> Mapping[str, str]:
    return step.record.recipe.inputs if step.record else {}


def _digest(step: Step, source: Source) -> str:
    digest = _inputs(step).get(source.name)
    return f"  {shown_digest(digest)}" if digest else ""
