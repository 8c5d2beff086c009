"""What one film costs: decoding alone, every job, every stage, the whole."""

from __future__ import annotations

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from tests.bench.captures import Film

PROJECT = Path(__file__).parents[2]
WATCH = Path(__file__).with_name("watch.py")
_MADE = re.compile(r"^rahas: (\S+): (\S+) made in ([0-9.]+) s", re.MULTILINE)
_VERDICT = "accepted"
_DECODE = """
import sys, time, av
started = time.perf_counter()
with av.open(sys.argv[1]) as container:
    frames = sum(1 for _ in container.decode(video=0))
    rate = float(container.streams.video[0].average_rate)
print(time.perf_counter() - started, frames / rate)
"""
_SNAKEMAKE = "import sys; sys.executable = sys.argv.pop(1); from snakemake.cli import main; main()"


class Job(NamedTuple):
    """One process of the workflow, its start included."""

    name: str
    wall_s: float
    cpu_s: float
    peak_mb: float


class Measurement(NamedTuple):
    """All figures of one film."""

    film: Film
    playing_s: float
    decode_s: float
    """PyAV alone, in a process of its own, without that process's start; median of three."""
    stages: dict[str, float]
    """By name, s."""
    jobs: list[Job]
    whole_s: float
    """`snakemake --cores 2` from its start to its end."""
    cpu_s: float
    """Of all processes."""


class Run(NamedTuple):
    """What `snakemake --cores 2` said and took."""

    output: str
    jobs: list[Job]
    whole_s: float
    cpu_s: float


def measured(root: Path, film: Film) -> Measurement:
    """Decode ``film`` alone, then process it from its video to its page."""
    decodings = [_decoding(root / "captures" / film.file) for _ in range(3)]
    shutil.rmtree(root / "results" / film.scan_id, ignore_errors=True)
    run = processed(root)
    verdict = json.loads((root / "results" / film.scan_id / "qa.json").read_text(encoding="utf-8"))["verdict"]
    if verdict != _VERDICT or not (root / "results" / film.scan_id / "report.html").exists():
        raise SystemExit(f"{film.title} was {verdict}: a bench of half a chain would be no bench\n{run.output}")
    return Measurement(
        film,
        playing_s=decodings[0][1],
        decode_s=statistics.median(seconds for seconds, _ in decodings),
        stages={stage: float(s) for scan, stage, s in _MADE.findall(run.output) if scan == film.scan_id},
        jobs=run.jobs,
        whole_s=run.whole_s,
        cpu_s=run.cpu_s,
    )


def processed(root: Path) -> Run:
    """Run the workflow on the expedition as anybody would, its jobs watched."""
    log = root / "jobs.jsonl"
    log.unlink(missing_ok=True)
    stand_in = root / "python"
    stand_in.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "{WATCH}" "{log}" "{sys.executable}" "$@"\n')
    stand_in.chmod(0o755)
    command = [sys.executable, "-c", _SNAKEMAKE, str(stand_in), "--cores", "2"]
    command += ["--snakefile", str(PROJECT / "Snakefile"), "--directory", str(root)]
    started, before = time.perf_counter(), os.times()
    done = subprocess.run(command, env=_environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    whole, after = time.perf_counter() - started, os.times()
    if done.returncode:
        raise SystemExit(done.stdout)
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return Run(done.stdout, _jobs(log), whole, cpu)


def _jobs(log: Path) -> list[Job]:
    jobs = []
    for line in log.read_text(encoding="utf-8").splitlines():
        entry = json.loads(line)
        words = entry["arguments"]
        command = words[words.index("rahas.cli") + 1 :]
        name = command[1] if command[0] == "job" else command[0]
        jobs.append(Job(name, entry["wall_s"], entry["cpu_s"], entry["peak_mb"]))
    return jobs


def _decoding(video: Path) -> tuple[float, float]:
    """Seconds that decoding takes, and that the film lasts."""
    said = subprocess.run(
        [sys.executable, "-c", _DECODE, str(video)], env=_environment(), check=True, capture_output=True, text=True
    )
    seconds, lasts = said.stdout.split()
    return float(seconds), float(lasts)


def _environment() -> dict[str, str]:
    """As a user's: byte code is kept, nothing is said of threads."""
    unset = ("PYTHONDONTWRITEBYTECODE", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return {name: value for name, value in os.environ.items() if name not in unset}
