"""Work done ahead: in order, no further than needed, and its failures where they are due."""

from __future__ import annotations

import pytest

from rahas.stages.ahead import DEPTH, ahead


def test_order_is_kept_and_nothing_runs_far_ahead() -> None:
    asked: list[int] = []
    results = ahead(lambda n: asked.append(n) or n * n, range(20))
    assert next(results) == 0
    assert len(asked) <= DEPTH + 1
    assert list(results) == [n * n for n in range(1, 20)]
    assert asked == list(range(20))


def test_a_failure_comes_where_its_result_is_due() -> None:
    results = ahead(lambda n: 6 // n, [3, 2, 0, 1])
    assert [next(results), next(results)] == [2, 3]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_a_reader_that_stops_early_leaves_nothing_running() -> None:
    asked: list[int] = []
    results = ahead(lambda n: asked.append(n) or n, range(1000))
    next(results)
    results.close()
    assert len(asked) <= DEPTH + 1
