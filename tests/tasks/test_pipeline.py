"""The stage table says all that a stage reads: what it left out would be a change that reruns nothing."""

from __future__ import annotations

import ast
import inspect
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_type_hints

import pytest

from rahas.params import Config
from rahas.stores.layout import ScanFolder
from rahas.tasks.pipeline import GATES, JOBS, STAGES, WITHDRAWN_WHEN_REJECTED, Stage, withdrawn_by

PACKAGE = Path(__file__).parents[2] / "rahas"
SCAN = ScanFolder(Path("results"), "scan")
ARTIFACTS = {path: stage.name for stage in STAGES.values() for path in stage.outputs(SCAN)}
NO_ARTIFACTS = {"path", "scan_id", "results", "records"}
NO_ROW: Any = SimpleNamespace(
    entry=SimpleNamespace(capture=None, texture=None), expedition=SimpleNamespace(target=None, captures=Path())
)
DISTRIBUTIONS = {"numpy": "numpy", "scipy": "scipy", "numba": "numba", "cv2": "opencv-python-headless", "av": "av"}
every_stage = pytest.mark.parametrize("stage", STAGES.values(), ids=STAGES)


def entry_of(stage: Stage) -> Any:
    module, _, name = stage.entry.partition(":")
    return getattr(import_module(module), name)


def reached_functions(stage: Stage) -> list[ast.FunctionDef]:
    """The entry and the functions of its own module that it calls."""
    module, _, name = stage.entry.partition(":")
    source = PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py")
    defined = {n.name: n for n in ast.parse(source.read_text("utf-8")).body if isinstance(n, ast.FunctionDef)}
    reached, pending = [], [name]
    while pending:
        function = defined.get(pending.pop())
        if function is not None and function not in reached:
            reached.append(function)
            pending += [n.id for n in ast.walk(function) if isinstance(n, ast.Name)]
    return reached


def folders_read(stage: Stage, name: str) -> set[str]:
    """Stages whose artifacts are asked for through a ScanFolder called ``name``."""
    asked = {
        node.attr
        for function in reached_functions(stage)
        for node in ast.walk(function)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == name
    }
    return {ARTIFACTS[getattr(SCAN, attribute)] for attribute in asked - NO_ARTIFACTS if hasattr(SCAN, attribute)}


@every_stage
def test_needs_are_what_is_read(stage: Stage) -> None:
    assert folders_read(stage, "scan") - {stage.name} == set(stage.needs)
    assert folders_read(stage, "calibration") == ({stage.borrows} if stage.borrows else set())


@every_stage
def test_every_argument_is_declared(stage: Stage) -> None:
    """A raw file, a column, a section or a calibration that is handed over stands in the recipe."""
    hints = get_type_hints(entry_of(stage))
    declared = {
        *stage.files(NO_ROW),
        *stage.columns,
        *(f"{section.split('_')[0]}_params" for section in stage.also_reads),
    }
    declared |= {"params"} if stage.section else set()
    declared |= {"calibration"} if stage.borrows else set()
    signature = inspect.signature(entry_of(stage))
    assert next(iter(signature.parameters)) == "scan"
    assert set(list(signature.parameters)[1:]) <= declared
    models = {name: info.annotation for name, info in Config.model_fields.items()}
    if stage.section:
        assert hints["params"] is models[stage.section]
    if "capture_params" in hints:
        assert hints["capture_params"] in {models[section] for section in stage.also_reads}


@every_stage
def test_parameters_are_in_the_recipe(stage: Stage) -> None:
    config = Config()
    work: Any = SimpleNamespace(expedition=SimpleNamespace(sections=config.model_dump(mode="json")))
    params = stage.params(work)
    assert stage.section is not None
    assert set(getattr(config, stage.section).model_dump()) <= set(params)
    for section in stage.also_reads:
        assert params[section] == getattr(config, section).model_dump(mode="json")


@every_stage
def test_libraries_are_declared(stage: Stage) -> None:
    """Versions of the libraries that the stage's own modules (kernels, stages) import stand in the recipe."""
    seen: set[Path] = set()
    imported: set[str] = set()
    pending = [PACKAGE.joinpath(*stage.entry.partition(":")[0].split(".")[1:]).with_suffix(".py")]
    while pending:
        source = pending.pop()
        if source in seen or not source.is_file():
            continue
        seen.add(source)
        for node in ast.walk(ast.parse(source.read_text("utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            for name in names:
                top, *rest = name.split(".")
                imported.add(top)
                if top == "rahas" and rest[:1] in (["kernels"], ["stages"]):
                    pending.append(PACKAGE.joinpath(*rest).with_suffix(".py"))
    wanted = {distribution for name, distribution in DISTRIBUTIONS.items() if name in imported}
    assert wanted <= set(stage.libraries)


def test_order_of_the_table_is_the_order_of_the_data() -> None:
    before: set[str] = set()
    for stage in STAGES.values():
        assert {*stage.needs, *stage.gates} <= before
        before.add(stage.name)
    assert set(GATES) <= before


@pytest.mark.parametrize("last", ["calibrate", "surface"])
def test_jobs_of_a_row_make_each_stage_once(last: str) -> None:
    chain = [JOBS["capture"], JOBS["phase"], JOBS[last]]
    made = [stage.name for job in chain for stage in job.stages()]
    assert len(made) == len(set(made))
    assert JOBS[last].is_last
    borrowed = {stage.borrows: job for job in chain for stage in job.stages() if stage.borrows}
    for source, job in borrowed.items():
        makers = [name for name, other in JOBS.items() if source in {s.name for s in other.stages()}]
        assert set(makers) & set(job.after_calibration), f"{job.name} does not wait for {source} of the calibration"


def test_a_rejection_withdraws_all_that_follows() -> None:
    assert set(withdrawn_by("ingest")) == set(STAGES) - {"ingest"}
    assert set(withdrawn_by("review_capture")) >= {"snakes", "review_result", *WITHDRAWN_WHEN_REJECTED}
    assert set(withdrawn_by("review_result")) == set(WITHDRAWN_WHEN_REJECTED)
