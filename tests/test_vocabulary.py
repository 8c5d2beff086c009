"""The vocabulary is whole, and what is generated from it is up to date."""

from __future__ import annotations

from pathlib import Path

import pytest

from rahas.report.glossary import vocabulary_markdown
from rahas.vocabulary import METRICS, QUANTITIES, Quantity

DOCS = Path(__file__).parents[1] / "docs"


def test_the_generated_page_has_not_drifted() -> None:
    assert (DOCS / "vocabulary.md").read_text(encoding="utf-8") == vocabulary_markdown()


def test_names_are_unique_and_definitions_there() -> None:
    names = [quantity.name for quantity in QUANTITIES]
    assert len(names) == len(set(names))
    assert all(quantity.definition and quantity.unit for quantity in QUANTITIES)
    assert all(metric.label and metric.definition for metric in METRICS)
    assert len({metric.name for metric in METRICS}) == len(METRICS)


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda quantity: quantity.name)
def test_a_row_is_consistent(quantity: Quantity) -> None:
    assert quantity.name != "phase"
    assert quantity.name.isidentifier()
    assert "|" not in quantity.definition
    if quantity.low is not None and quantity.high is not None:
        assert quantity.low < quantity.high
    if quantity.name.endswith("_deg"):
        assert quantity.unit == "°"
    if quantity.name.endswith("_rad"):
        assert quantity.unit == "rad"


def test_every_store_of_the_contract_is_described() -> None:
    wanted = {
        "frames.zarr": {"frames", "time_s"},
        "snakes.zarr": {"snake_identity", "snake_y", "snake_value", "unrotation_deg"},
        "phase.zarr": {
            "wrapped_phase", "unwrapped_phase", "fringe_order", "order_confidence", "background", "modulation",
            "phase_std", "quality", "phase_step",
        },
        "cloud.zarr": {"xyz", "xyz_before_debanding", "z_std", "rgb"},
    }  # fmt: skip
    for file, names in wanted.items():
        assert names <= {quantity.name for quantity in QUANTITIES if quantity.found_in == file}
