"""Work that does not depend on what came before it, done by a second thread while the first is busy with the rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")

DEPTH = 3


def ahead(make: Callable[[_Given], _Made], items: Iterable[_Given], *, depth: int = DEPTH) -> Iterator[_Made]:
    """``make`` of each item, in order, up to ``depth`` of them made before they are asked for.

    One thread makes them all, so ``make`` may keep state of its own. What it raises is raised where its result is due.

    >>> list(ahead(abs, [-1, 2]))
    [1, 2]
    """
    pending: deque[Future[_Made]] = deque()
    with ThreadPoolExecutor(1) as pool:
        try:
            for item in items:
                pending.append(pool.submit(make, item))
                if len(pending) > depth:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for left in pending:
                left.cancel()
