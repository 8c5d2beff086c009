"""Rules, and the verdict that they come to."""

from __future__ import annotations

from typing import Any

import pytest

from rahas.params import CaptureReviewParams, ResultReviewParams
from rahas.qa.rules import capture_findings, result_findings
from rahas.qa.verdict import verdict

GOOD: dict[str, Any] = {
    "rotation_frames": 100, "scan_frames": 120, "periods": 1.5, "object_span": 0.8, "jitter": 0.1, "contrast": 20.0,
    "clipped_share": 0.0, "clipped_high_share": 0.0, "clipped_low_share": 0.0, "dropped_frames": 0,
}  # fmt: skip
TIMELINE = {
    "intervals": [
        {"stage": "hold", "first": 0, "last": 9},
        {"stage": "rotation", "first": 10, "last": 109},
        {"stage": "hold", "first": 110, "last": 119},
        {"stage": "scan", "first": 120, "last": 239},
    ]
}
FIELDS = {"rule", "metric", "value", "limit", "unit", "message"}


def found(
    change: dict[str, Any], *, role: str = "scan", damage: list[Any] | None = None
) -> tuple[list[str], list[str]]:
    findings = capture_findings(
        GOOD | change, timeline=TIMELINE, damage=damage or [], role=role, params=CaptureReviewParams()
    )
    for one in [*findings.reasons, *findings.warnings]:
        assert set(one) == FIELDS
        assert one["message"].endswith((".", "help."))
    return [one["rule"] for one in findings.reasons], [one["rule"] for one in findings.warnings]


@pytest.mark.parametrize(
    ("change", "rules"),
    [
        ({}, []),
        ({"object_span": 0.5}, []),
        ({"object_span": 0.499}, ["object_span"]),
        ({"jitter": 1.0}, []),
        ({"jitter": 1.001}, ["jitter"]),
        ({"periods": 0.9}, []),
        ({"periods": 0.89}, ["timeline"]),
        ({"rotation_frames": 0}, ["timeline"]),
        ({"object_span": None, "jitter": None}, ["timeline"]),
        ({"contrast": 4.9}, ["contrast"]),
        ({"clipped_share": 0.11, "clipped_high_share": 0.11}, ["exposure"]),
        ({"jitter": 3.0, "object_span": 0.2}, ["object_span", "jitter"]),
    ],
)
def test_limits_reject_beyond_and_not_at(change: dict[str, Any], rules: list[str]) -> None:
    assert found(change)[0] == rules


def test_calibrations_are_exempt_from_the_span_only() -> None:
    assert found({"object_span": 0.2}, role="calibration") == ([], [])
    assert found({"object_span": 0.2, "jitter": 2.0}, role="calibration") == (["jitter"], [])


def test_jitter_that_cannot_be_measured_is_a_warning() -> None:
    assert found({"jitter": None}) == ([], ["jitter"])


def test_damage_rejects_in_rotation_and_scan_and_warns_elsewhere() -> None:
    def at(frame: int | None, last: int | None = None) -> list[dict[str, Any]]:
        return [{"kind": "decoder_message", "frame": frame, "last_frame": last, "message": "bits are missing"}]

    assert found({}, damage=at(50)) == (["damaged"], [])
    assert found({}, damage=at(112, 130)) == (["damaged"], [])
    assert found({}, damage=at(3)) == ([], ["damaged"])
    assert found({}, damage=at(112, 119)) == ([], ["damaged"])
    assert found({}, damage=at(None)) == ([], ["damaged"])


def test_result_gate() -> None:
    def rules(metrics: dict[str, Any], role: str = "scan") -> tuple[list[str], list[str]]:
        findings = result_findings(
            metrics, told=["a sentence"], role=role, params=ResultReviewParams(), capture_params=CaptureReviewParams()
        )
        return [one["rule"] for one in findings.reasons], [one["rule"] for one in findings.warnings]

    assert rules({"object_span": 0.7, "measured_share": 0.9, "ripple_after_rad": 0.01}) == ([], ["surface"])
    assert rules({"object_span": 0.3, "measured_share": 0.9})[0] == ["object_span"]
    assert rules({"object_span": 0.3, "measured_share": 0.9}, role="calibration")[0] == []
    assert rules({"object_span": 0.7, "measured_share": 0.1})[0] == ["coverage"]
    assert rules({"object_span": 0.7, "measured_share": 0.9, "ripple_after_rad": 0.3})[1] == ["surface", "banding"]


SHAKEN = {"metrics": {"object_span": 0.8, "jitter": 3.0}, "reasons": [{"rule": "jitter"}], "warnings": []}
CLEAN = {"metrics": {"object_span": 0.8, "jitter": 0.1}, "reasons": [], "warnings": [{"rule": "timeline"}]}
PROBLEM = {
    "rule": "unreadable",
    "metric": "capture",
    "value": None,
    "limit": None,
    "unit": "",
    "message": "It is a text.",
}


def given(**known: Any) -> dict[str, Any]:
    return verdict("a1", **{"decision": "", "processed": True, "overridden": False, **known})


def test_verdicts() -> None:
    assert given(capture=CLEAN)["verdict"] == "accepted"
    assert given(capture=SHAKEN)["verdict"] == "rejected"
    late = given(
        capture=CLEAN, result={"metrics": {"object_span": 0.4}, "reasons": [{"rule": "object_span"}], "warnings": []}
    )
    assert (late["verdict"], late["metrics"]["object_span"]) == ("rejected", 0.4)
    assert late["metrics"]["object_span_of_capture"] == 0.8
    unreadable = given(problem=PROBLEM)
    assert (unreadable["verdict"], unreadable["reasons"]) == ("rejected", [PROBLEM])


def test_the_operators_reject_is_not_processed() -> None:
    qa = given(decision="reject", processed=False)
    assert (qa["verdict"], qa["reasons"][0]["rule"], qa["decision"]) == ("not_processed", "operator", "reject")


def test_an_override_lets_through_and_is_marked() -> None:
    qa = given(decision="reject", capture=SHAKEN, overridden=True)
    assert (qa["verdict"], qa["reasons"], qa["overridden"]) == ("accepted", [], True)
    assert qa["warnings"][0]["rule"] == "jitter"
    assert qa["warnings"][0]["waived"] is True
    stopped = given(capture=SHAKEN, overridden=True, problem=PROBLEM)
    assert (stopped["verdict"], stopped["reasons"]) == ("rejected", [PROBLEM])
