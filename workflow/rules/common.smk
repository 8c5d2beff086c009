# The expedition, checked before anything runs, and what every rule needs to call a job.
import json
import os
import shlex
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

REPOSITORY = Path(workflow.basedir).resolve()
sys.path.insert(0, str(REPOSITORY))
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(REPOSITORY), os.environ.get("PYTHONPATH")])
)

from rahas.errors import ExpeditionError
from rahas.stores.digests import canonical_json
from rahas.tasks.expedition import check_writable, open_expedition
from rahas.tasks.plan import SUMMARY_UNASKED, Plan, makes
from rahas.tasks.resources import memory_mb, runtime_min

try:
    PLAN = Plan(open_expedition(Path.cwd(), config))
    if workflow.is_main_process:  # not by each job on a cluster's node
        check_writable(PLAN.expedition)
        if rendered := PLAN.to_render():
            # here, because it takes a while
            from rahas.tasks.book import check_book

            check_book(PLAN.expedition.root / "config" / "simulation.yaml", rendered)
except ExpeditionError as error:
    raise WorkflowError(str(error)) from None
if not PLAN.expedition.entries and workflow.is_main_process:
    logger.warning("field_log.csv has no row yet: write one for each capture")
for fault in PLAN.expedition.skipped if workflow.is_main_process else ():
    logger.warning(f"left out: {fault}")
for line in PLAN.announcement() if workflow.is_main_process else ():
    logger.warning(f"rahas: {line}")

# -P: nothing that lies in the expedition's folder is imported
RAHAS = f"{shlex.quote(sys.executable)} -P -m rahas.cli"
OPTIONS = f"--options {shlex.quote(json.dumps(dict(config)))}"


wildcard_constraints:
    scan="[A-Za-z0-9][A-Za-z0-9_-]*",
    key="[0-9a-f]{16}",
    number="[0-9]+",


def stamps_before(job):
    """Input function: the stamps that a job waits for."""
    return lambda wildcards: PLAN.inputs(job, wildcards.scan)


def recipe_of(job):
    """Params function: all that decides the job's output, as one canonical text."""
    return lambda wildcards: canonical_json(PLAN.recipe(job, wildcards.scan))


def group_of(wildcards):
    """Group function: on a cluster a row's jobs are submitted together; those of its calibration come before."""
    here = workflow.is_main_process and workflow.local_exec
    return None if here else PLAN.expedition.entry(wildcards.scan).role


def memory_of(job):
    """Resource function: MB that a job needs at most, as far as known; more at each further attempt."""
    return lambda wildcards, attempt: memory_mb(job, size_of(wildcards.scan), attempt)


def runtime_of(job):
    """Resource function: minutes, likewise."""
    return lambda wildcards, attempt: runtime_min(job, size_of(wildcards.scan), attempt)


def size_of(scan):
    """The capture's size, looked up only where it decides something: on a cluster, or within a limit of memory."""
    decides = workflow.non_local_exec or "mem_mb" in workflow.global_resources
    return PLAN.capture_size(scan) if decides else None
