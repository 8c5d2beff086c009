"""Expeditions run through `sbatch`: the project's own profile, with shorter waits."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.cluster.slurm import Slurm
from tests.workflow.expedition import MADE, Expedition, Run, copy_code, wait_for

# docs/CLUSTER.md: without an accounting database squeue has to say how jobs ended
SETTINGS = (
    *("--slurm-no-account", "--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", "1"),
    *("--latency-wait", "10", "--slurm-keep-successful-logs", "--retries", "0"),
)
wait_patiently = partial(wait_for, patience_s=600.0)
_JOB = re.compile(r"^ *Job \d+: ([^:\n]+): (.*)$", re.MULTILINE)


@dataclass(frozen=True)
class ClusterExpedition(Expedition):
    """An expedition whose jobs run on a cluster's node."""

    cluster: Slurm

    @property
    def command(self) -> list[str]:
        return [
            *(sys.executable, "-m", "snakemake", "--nocolor", "--profile", str(self.code / "profiles" / "slurm")),
            *("--snakefile", str(self.code / "Snakefile"), "--directory", str(self.root), *SETTINGS),
        ]

    def start(self, *arguments: str, **options: Any) -> subprocess.Popen[str]:
        """As a user on a login node: next to no environment, another folder."""
        shutil.rmtree(self.root / ".snakemake" / "slurm_logs", ignore_errors=True)
        return subprocess.Popen(
            [*self.command, *arguments], cwd="/", env={"HOME": str(self.root.parent), **self.cluster.environment},
            text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            start_new_session=True, **options,
        )  # fmt: skip

    def run(self, *arguments: str, timeout: float = 1800, **options: Any) -> Run:
        """What scheduler and jobs said; the jobs' own lines stand in Slurm's logs."""
        run = super().run(*arguments, timeout=timeout, **options)
        return Run(run.status, run.output + self.job_logs())

    def job_logs(self) -> str:
        """All that the jobs of the last run have said."""
        logs = sorted((self.root / ".snakemake" / "slurm_logs").rglob("*.log"))
        return "".join(log.read_text(encoding="utf-8", errors="replace") for log in logs)

    def made_so_far(self) -> list[tuple[str, str]]:
        """(scan_id, stage) computed by the last run."""
        return sorted(set(MADE.findall(self.job_logs())))

    def copy(self, root: Path) -> ClusterExpedition:
        copied = super().copy(root)
        return ClusterExpedition(copied.root, self.code, self.cluster)


def jobs_by_message(output: str) -> Counter[str]:
    """How many jobs of each kind a run started, by their messages' words: a scheduler's output, no job's."""
    return Counter(what for _, what in _JOB.findall(output))


def recorded_outputs(results: Path) -> dict[str, Any]:
    """Outcome and digests of the outputs of every record, by the record's path."""
    found = {}
    for record in sorted(results.glob("*/provenance/*.json")):
        content = json.loads(record.read_text(encoding="utf-8"))
        if "outputs" in content:
            found[str(record.relative_to(results))] = (content["outcome"], content["outputs"], content.get("reason"))
    return found


def embedded_expedition(root: Path, project: Path) -> Path:
    """The project as a fresh clone: its log, its configuration and its code, nothing rendered, nothing made."""
    copy_code(root, project)
    shutil.copy2(project / "field_log.csv", root / "field_log.csv")
    shutil.copytree(project / "config", root / "config")
    (root / "captures").mkdir()
    for source in (project / "captures").iterdir():
        if source.name != "simulated":
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, root / "captures" / source.name)
    if rows := os.environ.get("RAHAS_CLUSTER_ROWS"):  # while writing tests: a few rows alone
        header, *lines = (root / "field_log.csv").read_text(encoding="utf-8").splitlines()
        kept = [line for line in lines if line.split(",")[0] in rows.split(",")]
        (root / "field_log.csv").write_text("\n".join([header, *kept]) + "\n", encoding="utf-8")
    return root
