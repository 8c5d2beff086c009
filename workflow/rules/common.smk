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
from rahas.tasks.plan import Plan, makes

try:
    PLAN = Plan(open_expedition(Path.cwd(), config))
    check_writable(PLAN.expedition)
except ExpeditionError as error:
    raise WorkflowError(str(error)) from None
if not PLAN.expedition.entries:
    logger.warning("field_log.csv has no row yet: write one for each capture")
for fault in PLAN.expedition.skipped:
    logger.warning(f"left out: {fault}")

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
