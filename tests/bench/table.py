"""The bench's table, and which targets were missed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rahas.stores.capture_size import CaptureSize
from rahas.tasks.resources import NEEDS, NODE_MB, memory_mb
from tests.bench.measure import Job, Measurement

LARGEST_JOB_MB = 500.0
LONGEST_OF_PLAYING = 1.0
LATER_OF_DECODE = 5.0


def missed(found: Sequence[Measurement]) -> list[str]:
    """Targets that are missed, in words; a long film counts for memory only."""
    out = []
    for one in found:
        if one.film.slowness == 1.0 and one.whole_s > LONGEST_OF_PLAYING * one.playing_s:
            out.append(f"{one.film.title}: {one.whole_s:.1f} s from video to page, it plays {one.playing_s:.1f} s")
        out += [
            f"{one.film.title}: job {job.name} took {job.peak_mb:.0f} MB of {LARGEST_JOB_MB:.0f}"
            for job in one.jobs
            if job.peak_mb > LARGEST_JOB_MB
        ]
        size = CaptureSize(round(30 * one.playing_s), 720 * 480)
        out += [
            f"{one.film.title}: job {job.name} took {job.peak_mb:.0f} MB, on a cluster it asks for {asked}"
            for job in one.jobs
            if job.name in NEEDS and job.peak_mb > (asked := memory_mb(job.name, size) - NODE_MB)
        ]
    return out


def table(found: Sequence[Measurement]) -> str:
    """All figures as one Markdown table, a column a film."""
    rows: list[tuple[str, Callable[[Measurement], str]]] = [
        ("playing time, s", lambda m: f"{m.playing_s:.1f}"),
        ("decoding alone, s", lambda m: f"{m.decode_s:.2f}"),
    ]
    stages = dict.fromkeys(name for m in found for name in m.stages)
    jobs = dict.fromkeys(job.name for m in found for job in m.jobs)
    rows += [(f"stage {s}, s", lambda m, s=s: f"{m.stages[s]:.1f}" if s in m.stages else "–") for s in stages]
    rows += [(f"job {n}: wall / CPU s, peak MB", lambda m, n=n: _job(m.jobs, n)) for n in jobs]
    rows += [
        ("Snakemake itself, s", lambda m: f"{m.whole_s - sum(job.wall_s for job in m.jobs):.1f}"),
        ("**video to page, s**", lambda m: f"**{m.whole_s:.1f}**"),
        ("CPU of all processes, s", lambda m: f"{m.cpu_s:.1f}"),
        (f"of playing time (target ≤ {LONGEST_OF_PLAYING:g})", lambda m: f"{m.whole_s / m.playing_s:.2f}"),
        (f"of decoding alone (later ≤ {LATER_OF_DECODE:g})", lambda m: f"{m.whole_s / m.decode_s:.1f}"),
        (f"peak of any job, MB (≤ {LARGEST_JOB_MB:g})", lambda m: f"{max(job.peak_mb for job in m.jobs):.0f}"),
    ]
    lines = [["", *(m.film.title for m in found)], ["---", *("---:" for _ in found)]]
    lines += [[title, *(figure(m) for m in found)] for title, figure in rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return "\n".join("| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |" for line in lines)


def _job(jobs: Sequence[Job], name: str) -> str:
    """A job that is started more than once counts with all its starts."""
    own = [job for job in jobs if job.name == name]
    if not own:
        return "–"
    wall, cpu, peak = sum(j.wall_s for j in own), sum(j.cpu_s for j in own), max(j.peak_mb for j in own)
    times = f" ({len(own)} ×)" if len(own) > 1 else ""
    return f"{wall:.1f} / {cpu:.1f}, {peak:.0f}{times}"
