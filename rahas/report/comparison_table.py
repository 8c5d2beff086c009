"""A comparison of two runs for the terminal: counts, a table, then metrics, artifacts and causes in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rahas.report.words import VERDICT_WORDS, finding_line, metric_label, metric_unit, number, plain, value_text

Scan = Mapping[str, Any]


class Column(NamedTuple):
    """A column of the table: what it is called, in which unit, and the cell of a row."""

    group: str
    name: str
    cell: Any


def columns() -> list[Column]:
    """The table's columns, the same for terminal and page."""
    return [
        Column("", "scan", lambda s: s["scan_id"]),
        Column("", "verdict", verdict_change),
        Column("ΔZ, mm", "median", lambda s: _of(s, "depth", "median_mm", signed=True)),
        Column("ΔZ, mm", "rms", lambda s: _of(s, "depth", "rms_mm")),
        Column("ΔZ, mm", "95 %", lambda s: _of(s, "depth", "p95_mm")),
        Column("|ΔZ|/σ", "median", lambda s: _of(s, "depth", "median_sigmas")),
        Column("|ΔZ|/σ", "95 %", lambda s: _of(s, "depth", "p95_sigmas")),
        Column("points", "gained", lambda s: _count(s, "gained")),
        Column("points", "lost", lambda s: _count(s, "lost")),
        Column("orders", "changed", orders_changed),
        Column("phase", "rms, mrad", lambda s: _of(s, "phase", "rms_rad", factor=1e3)),
    ]


def comparison_text(found: Mapping[str, Any]) -> str:
    """The whole comparison as plain text."""
    return "\n".join([*headline(found), *_table(found), *_details(found), *_why(found), *_remarks(found)])


def headline(found: Mapping[str, Any]) -> list[str]:
    """Which sides, and how many rows differ in what."""
    scans = found["scans"]
    differing = [s for s in scans if s["differs"]]
    lines = [f"{side}  {side_text(found[side])}" for side in ("before", "after")]
    counts = [
        f"{len(scans)} rows: {len(differing)} differ",
        f"{sum(s['verdict'][0] != s['verdict'][1] for s in differing)} in their verdict",
    ]
    measured = [s for s in scans if s["depth"]]
    if measured:
        counts.append(f"surfaces of {len(measured)} compared")
    elif differing and not (found["before"]["has_data"] and found["after"]["has_data"]):
        counts.append("numbers and digests only: a run of the history holds no data")
    return [*lines, ", ".join(counts)]


def side_text(side: Mapping[str, Any]) -> str:
    """A side by its name; a run of the history with time, host and commit."""
    made = side["made"]
    told = [made.get("time"), made.get("host"), f"commit {made['commit'][:10]}" if made.get("commit") else None]
    if made.get("commit") and made.get("tree_clean") is False:
        told.append("edited")
    known = ", ".join(str(one) for one in told if one)
    return plain(f"{side['name']} ({known})" if known else side["name"])


def verdict_change(scan: Scan) -> str:
    """``accepted``, or ``accepted → rejected``; for a row that one side lacks, which side has it."""
    if scan["only"]:
        return f"only {scan['only']}"
    was, now = (VERDICT_WORDS.get(verdict, verdict) for verdict in scan["verdict"])
    return was if was == now else f"{was} → {now}"


def orders_changed(scan: Scan) -> str:
    """Share of the pixels measured on both sides whose fringe order changed."""
    phase = scan["phase"]
    if not phase or not phase["compared"]:
        return "—" if scan["phase"] else ""
    return f"{number(100 * phase['orders_changed'] / phase['compared'])} %"


def metric_changes(scan: Scan) -> list[tuple[str, str, str, str]]:
    """(label, before, after, change) of each metric that differs."""
    rows = []
    for name, (was, now) in scan["metrics"].items():
        both = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (was, now))
        unit = metric_unit(name)
        unit = "" if unit.startswith("of ") else unit  # of the image, of the frames: a pure number
        step = f"{'+' if now > was else ''}{number(now - was)}" if both else ""
        rows.append((metric_label(name), *_apart(was, now, unit), step))
    return rows


def artifact_line(scan: Scan) -> str:
    """``changed: cloud.ply, cloud.zarr; new: …``."""
    words: dict[str, list[str]] = {}
    for path, word in scan["artifacts"].items():
        words.setdefault(word, []).append(path)
    return "; ".join(f"{word}: {', '.join(paths)}" for word, paths in words.items())


def cause_lines(found: Mapping[str, Any]) -> list[str]:
    """Each change of a recipe once, with the rows that it holds for."""
    return [f"{why['stage']}: {why['text']} ({_some(why['scans'], len(found['scans']))})" for why in found["why"]]


def _table(found: Mapping[str, Any]) -> Iterator[str]:
    scans = [s for s in found["scans"] if s["differs"]]
    if not scans:
        return
    shown = [c for c in columns() if c.name in ("scan", "verdict") or any(c.cell(s) for s in scans)]
    groups = [c.group if not n or shown[n - 1].group != c.group else "" for n, c in enumerate(shown)]
    rows = [groups, [c.name for c in shown], *([plain(c.cell(s)) for c in shown] for s in scans)]
    widths = [max(len(row[n]) for row in rows) for n in range(len(shown))]
    yield ""
    for row in rows:
        cells = [c.ljust(w) if n < 2 else c.rjust(w) for n, (c, w) in enumerate(zip(row, widths, strict=True))]
        yield "  ".join(cells).rstrip()


def _details(found: Mapping[str, Any]) -> Iterator[str]:
    for scan in (s for s in found["scans"] if s["differs"] and not s["only"]):
        yield from ("", scan["scan_id"])
        for side, reasons in zip(("before", "after"), scan["reasons"], strict=True):
            yield from (f"  reason {side}: {plain(finding_line(reason))}" for reason in reasons)
        for label, was, now, step in metric_changes(scan):
            yield f"  {plain(label)}: {plain(was)} → {plain(now)}" + (f"  ({step})" if step else "")
        if scan["artifacts"]:
            yield f"  {plain(artifact_line(scan))}"
        yield from (f"  {plain(note)}" for note in scan["notes"])


def _why(found: Mapping[str, Any]) -> Iterator[str]:
    lines = cause_lines(found)
    if lines:
        yield from ("", "Why" if found["differs"] else "Made in another way, to the same bytes")
        yield from (f"  {plain(line)}" for line in lines)


def _remarks(found: Mapping[str, Any]) -> list[str]:
    return [] if found["differs"] else ["", "Nothing differs."]


def _some(scans: Sequence[str], of: int) -> str:
    if len(scans) == of and of > 1:
        return f"all {of} rows"
    return ", ".join(scans) if len(scans) <= 6 else f"{', '.join(scans[:5])} and {len(scans) - 5} more"


def _of(scan: Scan, part: str, name: str, *, signed: bool = False, factor: float = 1.0) -> str:
    if not scan[part]:
        return ""
    value = scan[part][name]
    if value is None:
        return "—"
    return ("+" if signed and value > 0 else "") + number(factor * value)


def _count(scan: Scan, name: str) -> str:
    return f"{scan['depth'][name]}" if scan["depth"] else ""


def _apart(was: Any, now: Any, unit: str) -> tuple[str, str]:
    """Both values with as many digits as tell them apart."""
    pair = value_text(was, unit), value_text(now, unit)
    if pair[0] != pair[1]:
        return pair
    numbers = all(isinstance(v, int | float) for v in (was, now))
    texts = [number(v, span=abs(now - was)) if numbers else repr(v) for v in (was, now)]
    return tuple(f"{t}\u202f{unit}" if unit else t for t in (texts if texts[0] != texts[1] else (repr(was), repr(now))))  # type: ignore[return-value]
