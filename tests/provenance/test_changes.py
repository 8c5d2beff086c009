"""What changed between two recipes, in words."""

from __future__ import annotations

from dataclasses import replace

from rahas.provenance.changes import ABSENT, Change, changes, in_words, shown_digest
from rahas.provenance.records import Recipe
from rahas.stores.digests import digest_of_json

OLD_CODE = {"rahas.kernels.near:useful": "1", "rahas.kernels.near:LIMIT": "2", "rahas.tasks.one:run": "3"}
NEW_CODE = {"rahas.kernels.near:useful": "9", "rahas.tasks.one:run": "3", "rahas.kernels.far:Away": "4"}
RECIPE = Recipe(
    stage="cloud",
    inputs={"phase": "made " + "a" * 64, "texture": "none photo.png"},
    columns={"role": "scan"},
    params={"deband": True, "limits": {"low": 1.0, "high": 2.0}},
    code=digest_of_json(OLD_CODE),
    libraries={"numpy": "2.0", "scipy": "1.0"},
)


def texts(found: list[Change]) -> list[str]:
    return [change.text for change in found]


def test_equal_recipes_have_no_changes() -> None:
    assert changes(RECIPE, replace(RECIPE)) == []


def test_parameters_are_told_with_their_values() -> None:
    new = replace(RECIPE, params={"deband": False, "limits": {"low": 1.0, "middle": 1.5}})
    found = changes(RECIPE, new)
    assert [(c.kind, c.name, c.was, c.now) for c in found] == [
        ("parameter", "deband", True, False),
        ("parameter", "limits.high", 2.0, ABSENT),
        ("parameter", "limits.middle", ABSENT, 1.5),
    ]
    assert texts(found) == [
        "parameter deband: True → False",
        "parameter limits.high: no longer read (was 2.0)",
        "parameter limits.middle: new (1.5)",
    ]


def test_swapped_values_are_two_changes() -> None:
    found = changes(RECIPE, replace(RECIPE, params={"deband": True, "limits": {"low": 2.0, "high": 1.0}}))
    assert {c.name for c in found} == {"limits.low", "limits.high"}


def test_code_is_told_by_function_and_file() -> None:
    new = replace(RECIPE, code=digest_of_json(NEW_CODE))
    found = changes(RECIPE, new, old_code=OLD_CODE, new_code=NEW_CODE)
    assert texts(found) == [
        "code: class Away of rahas/kernels/far.py is new",
        "code: constant LIMIT of rahas/kernels/near.py is no longer used",
        "code: function useful of rahas/kernels/near.py was edited",
    ]
    unknown = changes(RECIPE, new, new_code=NEW_CODE)
    assert [c.kind for c in unknown] == ["code"]
    assert "not known" in unknown[0].text


def test_many_definitions_of_a_file_are_one_clause() -> None:
    before = {f"rahas.kernels.near:f{n}": "1" for n in range(5)}
    after = dict.fromkeys(before, "2")
    found = changes(RECIPE, replace(RECIPE, code="x"), old_code=before, new_code=after | {"rahas.kernels.far:g": "1"})
    assert len(found) == 6
    assert in_words(found) == (
        "code: function g of rahas/kernels/far.py is new; "
        "code: 5 definitions of rahas/kernels/near.py were edited (f0, f1, f2, f3, f4)"
    )


def test_inputs_columns_and_libraries() -> None:
    new = replace(
        RECIPE,
        inputs={"phase": "made " + "b" * 64, "texture": "c" * 64},
        columns={"role": "calibration"},
        libraries={"numpy": "2.1", "scipy": "1.0"},
    )
    assert texts(changes(RECIPE, new)) == [
        "input phase: other content (made aaaaaaaa → made bbbbbbbb)",
        "input texture: there was none, now there is",
        "column role of the log: 'scan' → 'calibration'",
        "library numpy: 2.0 → 2.1",
    ]
    assert "input texture: is gone" in texts(changes(new, RECIPE))


def test_only_digests_are_cut() -> None:
    assert shown_digest("made " + "a" * 64) == "made aaaaaaaa"
    assert shown_digest("none a photo of the whole river bank.png") == "none a photo of the whole river bank.png"
