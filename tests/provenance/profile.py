"""What the Provenance Run Crate profile asks for, as a checklist over the entities of a crate.

Sources: RO-Crate 1.1, Workflow RO-Crate 1.0, and of Workflow Run RO-Crate 0.5 the profiles Process Run Crate, Workflow
Run Crate and Provenance Run Crate. Each item has the level that these give it; "should" items that are left out on
purpose stand in :data:`NOT_TOLD`. The public validator fetches the profiles from the network, so it is not used here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import date, datetime
from typing import Any

Entity = dict[str, Any]
Graph = dict[str, Entity]

PROFILES = ("process", "workflow", "provenance")
TOOL_TYPES = {"SoftwareApplication", "SoftwareSourceCode", "ComputationalWorkflow"}
SLOT_TYPES = {"File", "Dataset", "Collection", "PropertyValue", "Boolean", "Integer", "Float", "Number", "Text"}
NOT_TOLD = (
    "CreateAction.agent (who ran the command is not recorded, only where)",
    "SoftwareApplication.url of the stages and libraries (no registry's address stands in a file of the project)",
)


def graph_of(content: dict[str, Any]) -> Graph:
    """Entities by identifier; each stands there once."""
    entities = content["@graph"]
    graph = {entity["@id"]: entity for entity in entities}
    assert len(graph) == len(entities), "two entities with the same @id"
    return graph


def types(entity: Entity) -> set[str]:
    found = entity["@type"]
    return set(found) if isinstance(found, list) else {found}


def links(entity: Entity, name: str) -> list[str]:
    """Identifiers that a property refers to."""
    value = entity.get(name, [])
    return [one["@id"] for one in (value if isinstance(value, list) else [value])]


def of_type(graph: Graph, name: str) -> list[Entity]:
    return [entity for entity in graph.values() if name in types(entity)]


def run_of(graph: Graph) -> Entity:
    """The CreateAction whose instrument is the main workflow."""
    [main] = links(graph["./"], "mainEntity")
    [run] = [action for action in of_type(graph, "CreateAction") if links(action, "instrument") == [main]]
    return run


def steps_done(graph: Graph) -> list[Entity]:
    """The CreateActions of the workflow's tools."""
    run = run_of(graph)
    return [action for action in of_type(graph, "CreateAction") if action is not run]


# ---- RO-Crate 1.1 ----
def check_descriptor(graph: Graph) -> Iterator[bool]:
    """MUST: a metadata descriptor about the root, conforming to RO-Crate; Workflow RO-Crate's own permalink too."""
    descriptor = graph["ro-crate-metadata.json"]
    yield descriptor["@type"] == "CreativeWork"
    yield links(descriptor, "about") == ["./"]
    yield set(links(descriptor, "conformsTo")) == {
        "https://w3id.org/ro/crate/1.1",
        "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
    }


def check_root(graph: Graph) -> Iterator[bool]:
    """MUST: Dataset with name, description, datePublished (a day at least) and license, that is an entity."""
    root = graph["./"]
    yield root["@type"] == "Dataset"
    yield bool(root["name"] and root["description"])
    yield bool(date.fromisoformat(root["datePublished"]))
    [licence] = links(root, "license")
    yield bool(graph[licence]["name"] and graph[licence]["description"])


def check_parts(graph: Graph) -> Iterator[bool]:
    """MUST: every File and Dataset is reached from the root through hasPart, its address a relative one."""
    reached, pending = set(), ["./"]
    while pending:
        reached.add(pending[-1])
        pending += [part for part in links(graph[pending.pop()], "hasPart") if part not in reached]
    data = {entity["@id"] for entity in graph.values() if types(entity) & {"File", "Dataset"}}
    yield data <= reached
    yield not [address for address in data if address.startswith("/") or " " in address]
    yield all(address.endswith("/") == ("Dataset" in types(graph[address])) for address in data)


def check_links(graph: Graph) -> Iterator[bool]:
    """MUST: what is referred to inside the crate is described there."""
    for entity in graph.values():
        for value in entity.values():
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, dict):
                    yield set(one) == {"@id"}
                    yield one["@id"] in graph or one["@id"].startswith(("http://", "https://"))


# ---- Process Run Crate ----
def check_conforms(graph: Graph) -> Iterator[bool]:
    """MUST: the root conforms to the three profiles, each a CreativeWork; SHOULD: to Workflow RO-Crate as well."""
    told = set(links(graph["./"], "conformsTo"))
    wanted = {f"https://w3id.org/ro/wfrun/{name}/0.5" for name in PROFILES}
    yield wanted | {"https://w3id.org/workflowhub/workflow-ro-crate/1.0"} == told
    yield all(graph[one]["@type"] == "CreativeWork" and graph[one]["version"] for one in told)


def check_tools(graph: Graph) -> Iterator[bool]:
    """MUST: a type of software; SHOULD: name and version, one of version and softwareVersion only."""
    [main] = links(graph["./"], "mainEntity")
    for identifier in links(graph[main], "hasPart"):
        tool = graph[identifier]
        yield bool(types(tool) & TOOL_TYPES)
        yield bool(tool["name"])
        yield ("version" in tool) != ("softwareVersion" in tool)
        yield all("softwareVersion" in graph[library] for library in links(tool, "softwareRequirements"))


def check_actions(graph: Graph) -> Iterator[bool]:
    """MUST: instrument; SHOULD: name, description, mentioned by the root, result (of those that did not fail)."""
    mentioned = set(links(graph["./"], "mentions"))
    for action in of_type(graph, "CreateAction"):
        [tool] = links(action, "instrument")
        yield bool(types(graph[tool]) & TOOL_TYPES)
        yield bool(action["name"] and action["description"])
        yield action["@id"] in mentioned
        failed = links(action, "actionStatus") == ["http://schema.org/FailedActionStatus"]
        yield failed == ("error" in action)
        yield not (failed and links(action, "result"))
        for name in {"startTime", "endTime"} & set(action):
            yield datetime.fromisoformat(action[name]).tzinfo is not None


def check_what_actions_touch(graph: Graph) -> Iterator[bool]:
    """SHOULD: objects and results are Files, Datasets, PropertyValues, or works that are no longer there."""
    allowed = {"File", "Dataset", "PropertyValue", "CreativeWork"}
    for action in of_type(graph, "CreateAction"):
        yield all(types(graph[one]) & allowed for one in links(action, "object") + links(action, "result"))


# ---- Workflow Run Crate ----
def check_main(graph: Graph) -> Iterator[bool]:
    """MUST: a ComputationalWorkflow as mainEntity, with its language, and an action that ran it."""
    [main] = links(graph["./"], "mainEntity")
    yield {"File", "SoftwareSourceCode", "ComputationalWorkflow"} <= types(graph[main])
    [language] = links(graph[main], "programmingLanguage")
    yield graph[language]["@type"] == "ComputerLanguage"
    yield bool(run_of(graph))


def check_slots(graph: Graph) -> Iterator[bool]:
    """MUST: a FormalParameter has its additionalType; SHOULD: its name; what stands for one refers to it."""
    for slot in of_type(graph, "FormalParameter"):
        yield slot["additionalType"] in SLOT_TYPES
        yield bool(slot["name"])
    for value in of_type(graph, "PropertyValue"):
        yield all("FormalParameter" in types(graph[one]) for one in links(value, "exampleOfWork"))
        yield len(links(value, "exampleOfWork")) == 1
        yield "value" in value
    for tool in [graph[one] for one in links(graph[links(graph["./"], "mainEntity")[0]], "hasPart")]:
        yield all("FormalParameter" in types(graph[s]) for s in links(tool, "input") + links(tool, "output"))


# ---- Provenance Run Crate ----
def check_workflow(graph: Graph) -> Iterator[bool]:
    """MUST: the workflow names its tools by hasPart and, as a HowTo, its steps."""
    workflow = graph[links(graph["./"], "mainEntity")[0]]
    yield "HowTo" in types(workflow)
    yield {links(action, "instrument")[0] for action in steps_done(graph)} == set(links(workflow, "hasPart"))
    yield set(links(workflow, "step")) == {step["@id"] for step in of_type(graph, "HowToStep")}


def check_steps(graph: Graph) -> Iterator[bool]:
    """MUST: a step names its tool; its position is past that of each step whose results it needs."""
    for step in of_type(graph, "HowToStep"):
        yield bool(links(step, "workExample"))
        yield all(types(graph[tool]) & TOOL_TYPES for tool in links(step, "workExample"))
    step_of = {t: s for s in of_type(graph, "HowToStep") for t in links(s, "workExample")}
    position = {a["@id"]: int(step_of[links(a, "instrument")[0]]["position"]) for a in steps_done(graph)}
    maker = {one: a["@id"] for a in steps_done(graph) for one in links(a, "result")}
    for action in steps_done(graph):
        made_by = {maker[one] for one in links(action, "object") if one in maker}
        own = action["@id"]
        # a scan's phase reads its calibration's, which is the same step of another row
        yield all(position[one] < position[own] or _row(one) != _row(own) for one in made_by)


def _row(action: str) -> str:
    return action.split("/")[1]


def check_controls(graph: Graph) -> Iterator[bool]:
    """MUST: a ControlAction's instrument is a step, its object the CreateAction of that step's tool; one for each."""
    controls = of_type(graph, "ControlAction")
    for control in controls:
        [step], [done] = links(control, "instrument"), links(control, "object")
        yield graph[step]["@type"] == "HowToStep"
        yield links(graph[done], "instrument")[0] in links(graph[step], "workExample")
    yield sorted(links(c, "object")[0] for c in controls) == sorted(a["@id"] for a in steps_done(graph))


def check_engine(graph: Graph) -> Iterator[bool]:
    """MUST: an OrganizeAction's instrument is the engine, its objects the ControlActions, its result the run."""
    [organised] = of_type(graph, "OrganizeAction")
    [engine] = links(organised, "instrument")
    yield "SoftwareApplication" in types(graph[engine])
    yield set(links(organised, "object")) == {control["@id"] for control in of_type(graph, "ControlAction")}
    yield links(organised, "result") == [run_of(graph)["@id"]]


CHECKS: tuple[Callable[[Graph], Iterator[bool]], ...] = (
    *(check_descriptor, check_root, check_parts, check_links, check_conforms, check_tools, check_actions),
    *(check_what_actions_touch, check_main, check_slots, check_workflow, check_steps, check_controls, check_engine),
)
