"""The whole expedition as a Workflow Run RO-Crate: RO-Crate 1.1, profile Provenance Run Crate 0.5.

The profile is a rendering of W3C PROV in schema.org's words: a CreateAction is a prov:Activity, a File or Dataset a
prov:Entity, ``object`` and ``result`` are prov:used and prov:generated, ``instrument`` names the software agent.

What was done (one CreateAction a stage and row, each with the ControlAction of its step) is told from the records;
what could be done (tools, slots, steps) is told in :mod:`rahas.provenance.crate_tools`. Nothing is copied: the crate
refers to the files where they lie. Equal records and companions give equal text.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from rahas.provenance.actions import Action, Artifact
from rahas.provenance.crate_data import DataEntities, Entity, reference, references
from rahas.provenance.crate_tools import Tools, step_of
from rahas.provenance.records import MADE, PROBLEM

METADATA = "ro-crate-metadata.json"
CONTEXT = ["https://w3id.org/ro/crate/1.1/context", "https://w3id.org/ro/terms/workflow-run/context"]
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
WORKFLOW_CRATE = "https://w3id.org/workflowhub/workflow-ro-crate/1.0"
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/provenance/0.5": ("Provenance Run Crate", "0.5"),
    WORKFLOW_CRATE: ("Workflow RO-Crate", "1.0"),
}
_SNAKEMAKE = "https://w3id.org/workflowhub/workflow-ro-crate#snakemake"
_RUN, _ENGINE, _ENGINE_RUN, _LICENCE = "#run", "#engine", "#engine-run", "#licence"


class Facts(NamedTuple):
    """What is told of the expedition beside its actions."""

    name: str
    description: str
    published: str
    """Date, YYYY-MM-DD."""
    version: str
    """Of this project."""
    engine: str
    """Version of Snakemake."""
    workflow: Artifact
    settings: Sequence[Artifact]
    """The expedition's own files: log, configuration, target."""
    table: Artifact
    """The actions as a table."""
    stages: Sequence[str]
    """In the order of the data."""


def crate_text(facts: Facts, actions: Sequence[Action], *, prefix: str = "") -> str:
    """The content of ro-crate-metadata.json, one entity a line.

    ``prefix`` leads from the crate's folder to the expedition's: empty, or ending with a slash.
    """
    lines = (json.dumps(entity, ensure_ascii=False, allow_nan=False) for entity in _graph(facts, actions, prefix))
    return f'{{"@context": {json.dumps(CONTEXT)},\n"@graph": [\n' + ",\n".join(lines) + "\n]}\n"


def _graph(facts: Facts, actions: Sequence[Action], prefix: str) -> list[Entity]:
    data, tools = DataEntities(prefix), Tools()
    workflow = data.add(facts.workflow)
    slots = {one.path: f"#input/workflow/{one.path}" for one in facts.settings}
    settings = [data.add(one, [slots[one.path]]) for one in facts.settings]
    data.add(facts.table)
    for action in actions:  # what lies there now is told first: a path's digest is that of its maker
        for made in action.outputs:
            data.add(made)
    done = [_create_action(action, data, tools) for action in actions]
    controls = [_control_action(action) for action in actions]
    steps = tools.steps(facts.stages)
    made = {one["@id"] for action in done for one in action.get("result", [])}
    read = [one["@id"] for action in done for one in action["object"] if not one["@id"].startswith("#")]
    results = [one["@id"] for action in done for one in action.get("result", [])]
    times = {"startTime": min((a.began for a in actions if a.began), default=None),
             "endTime": max((a.ended for a in actions if a.ended), default=None)}  # fmt: skip
    run: Entity = {
        "@id": _RUN,
        "@type": "CreateAction",
        "name": f"Processing of {facts.name}",
        "description": "Everything that led to the results as they stand, in however many runs of the same command.",
        "instrument": reference(workflow),
        "object": references([*settings, *(one for one in read if one not in made)]),
        "result": references(results),
    } | {name: time for name, time in times.items() if time}
    return [
        {
            "@id": METADATA,
            "@type": "CreativeWork",
            "about": reference("./"),
            "conformsTo": references([SPECIFICATION, WORKFLOW_CRATE]),
        },
        {
            "@id": "./",
            "@type": "Dataset",
            "name": facts.name,
            "description": facts.description,
            "datePublished": facts.published,
            "license": reference(_LICENCE),
            "conformsTo": references(list(PROFILES)),
            "mainEntity": reference(workflow),
            "hasPart": references(data.parts),
            "mentions": references([_RUN, _ENGINE_RUN, *(action["@id"] for action in done)]),
        },
        *_fixed_entities(facts),
        {
            **data.entities.pop(workflow),
            "@type": ["File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo"],
            "name": "RAHAS: from the video of a hand-cranked structured-light scanner to measured surfaces",
            "version": facts.version,
            "programmingLanguage": reference(_SNAKEMAKE),
            "input": references(list(slots.values())),
            "hasPart": references(tools.tools),
            "step": [reference(step["@id"]) for step in steps],
        },
        *({"@id": slots[one.path], "@type": "FormalParameter", "name": one.path, "additionalType": "File"}
          for one in facts.settings),
        *steps,
        *tools.entities.values(),
        run,
        {
            "@id": _ENGINE_RUN,
            "@type": "OrganizeAction",
            "name": f"Snakemake on {facts.name}",
            "instrument": reference(_ENGINE),
            "object": references([control["@id"] for control in controls]),
            "result": reference(_RUN),
        },
        *controls,
        *done,
        *data.entities.values(),
    ]  # fmt: skip


def _create_action(action: Action, data: DataEntities, tools: Tools) -> Entity:
    tool = tools.add(action)
    read = [data.add(one, [tools.slot(tool, action.stage, "input", one)]) for one in action.inputs]
    values = [tools.value(tool, action.stage, *one) for one in sorted(action.parameters.items())]
    made = [data.add(one, [tools.slot(tool, action.stage, "output", one)]) for one in action.outputs]
    entity: Entity = {
        "@id": _action_of(action),
        "@type": "CreateAction",
        "name": f"{action.stage} of {action.scan_id}",
        "description": _description(action),
        "instrument": reference(tool),
        "object": references([*read, *values]),
        "result": references(made),
        "startTime": action.began,
        "endTime": action.ended,
    }
    if action.outcome == PROBLEM:
        entity["actionStatus"] = reference("http://schema.org/FailedActionStatus")
        entity["error"] = action.message
    return {name: value for name, value in entity.items() if value or name == "object"}


def _description(action: Action) -> str:
    words = [f"outcome: {action.outcome}"]
    if action.outcome not in (MADE, PROBLEM):
        words = [f"outcome: {action.outcome}, made and taken away again when the scan was rejected"]
    words += [f"host: {action.host}"] if action.host else []
    words += [f"commit: {action.commit}"] if action.commit else []
    return "; ".join(words)


def _control_action(action: Action) -> Entity:
    return {
        "@id": f"#control/{action.key}",
        "@type": "ControlAction",
        "name": f"step {action.stage} for {action.scan_id}",
        "instrument": reference(step_of(action.stage)),
        "object": reference(_action_of(action)),
    }


def _action_of(action: Action) -> str:
    return f"#action/{action.key}"


def _fixed_entities(facts: Facts) -> Iterable[dict[str, Any]]:
    for identifier, (name, version) in PROFILES.items():
        yield {"@id": identifier, "@type": "CreativeWork", "name": name, "version": version}
    yield {
        "@id": _LICENCE,
        "@type": "CreativeWork",
        "name": "No licence stated",
        "description": "Ask those who made the captures before using them.",
    }
    yield {
        "@id": _SNAKEMAKE,
        "@type": "ComputerLanguage",
        "name": "Snakemake",
        "identifier": reference("https://doi.org/10.1093/bioinformatics/bts480"),
        "url": reference("https://snakemake.readthedocs.io"),
    }
    yield {
        "@id": _ENGINE,
        "@type": "SoftwareApplication",
        "name": "Snakemake",
        "url": "https://snakemake.readthedocs.io",
        "softwareVersion": facts.engine,
    }
