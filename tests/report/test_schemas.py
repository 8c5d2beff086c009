"""The public files' schemas: valid themselves, true of good files, refusing wrong ones."""

from __future__ import annotations

import copy
import csv
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from rahas.errors import CaptureProblem
from rahas.stores.atomic import write_json
from rahas.tasks import summary
from tests.report import expedition_builder as build

SCHEMAS = Path(__file__).parents[2] / "docs" / "schemas"
NAMES = ("timeline", "qa", "review", "calibration", "scans")


def schema(name: str) -> dict[str, Any]:
    return json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))


def validate(name: str, value: Any) -> None:
    jsonschema.Draft202012Validator(schema(name)).validate(value)


def example(name: str) -> dict[str, Any]:
    if name == "timeline":
        return build.timeline()
    if name == "qa":
        return build.verdict(outcome="rejected", reasons=[build.reason()])
    if name == "review":
        return {
            "reasons": [build.reason()],
            "warnings": [],
            "metrics": {"jitter": 3.4, "contrast": None},
            "series": {"displacement_px": [None, [0.1, -0.2]]},
        }
    if name == "calibration":
        return build.calibration()
    row = {"scan_id": "a", "site": "b", "role": "scan", "decision": "", "verdict": "", "rule": "", "message": ""}
    return row | {"jitter": "0.1"}


@pytest.mark.parametrize("name", NAMES)
def test_schema_is_a_schema_and_holds_for_a_good_file(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(schema(name))
    validate(name, example(name))


@pytest.mark.parametrize("name", NAMES)
def test_every_required_key_is_missed(name: str) -> None:
    for key in schema(name)["required"]:
        value = example(name)
        del value[key]
        with pytest.raises(jsonschema.ValidationError):
            validate(name, value)


@pytest.mark.parametrize(
    ("name", "path", "wrong"),
    [
        ("timeline", ("intervals", 0, "stage"), "pause"),
        ("timeline", ("intervals", 0, "first"), -1),
        ("timeline", ("rotation_sense",), 0),
        ("timeline", ("slide_angle_deg", 3), "1.0"),
        ("qa", ("verdict",), "maybe"),
        ("qa", ("reasons",), []),
        ("qa", ("decision",), "kept"),
        ("qa", ("scan_id",), "../x"),
        ("qa", ("reasons", 0, "message"), ""),
        ("review", ("metrics", "jitter"), [1]),
        ("calibration", ("camera", "matrix"), [[1, 2, 3, 4]]),
        ("calibration", ("marks", 0, "x_px"), None),
        ("scans", ("verdict",), "done"),
    ],
)
def test_wrong_values_are_refused(name: str, path: tuple[Any, ...], wrong: Any) -> None:
    value = copy.deepcopy(example(name))
    target: Any = value
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = wrong
    with pytest.raises(jsonschema.ValidationError):
        validate(name, value)


def test_a_capture_problem_is_a_finding() -> None:
    problem = CaptureProblem("calibration", "marks_found", "Too few marks.", value=3, limit=14, unit="marks")
    validate("review", {"reasons": [problem.as_reason()], "warnings": [], "metrics": {}})


def test_the_written_table_holds_to_its_schema(tmp_path: Path) -> None:
    write_json(tmp_path / "rock1" / "qa.json", build.verdict(outcome="rejected", reasons=[build.reason()]))
    summary.run(tmp_path, [build.entry("rock1"), build.entry("rock2")])
    with open(tmp_path / "scans.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2
    for row in rows:
        validate("scans", row)
