"""Why runs of a case failed or are missing, from all its pieces."""

from __future__ import annotations

from relnav_sim.results.block import BlockResult, Failure, RefusedError
from relnav_sim.results.case_rows import CaseRows
from relnav_sim.results.shards import ShardInfo


class CaseFailures:
    """The failures of a case, taken from its pieces one at a time.

    Args:
        rows: The case with all its pieces.
    """

    def __init__(self, rows: CaseRows) -> None:
        self._rows = rows
        self._held = {name: frozenset(runs) for name, runs in rows.filters.items()}
        self._known: dict[tuple[int, str], frozenset[Failure]] = {}

    def take(self, info: ShardInfo, block: BlockResult) -> None:
        """Take the failures of a piece; a run that another piece holds as well must have failed alike.

        Raises:
            RefusedError: It has not.
        """
        if info.retry:
            self._keep_reasons(info, block)
            return
        for name in info.filters:
            self._take_filter(info, block, name)

    def _keep_reasons(self, info: ShardInfo, block: BlockResult) -> None:
        """Keep why runs are missing that no other piece holds."""
        for failure in block.failures:
            for name in info.filters:
                missing = failure.run < self._rows.runs and failure.run not in self._held.get(name, ())
                if missing and failure.filter in ("", name):
                    self._known[failure.run, name] = frozenset({failure})

    def _take_filter(self, info: ShardInfo, block: BlockResult, name: str) -> None:
        """Keep why runs of a filter failed. Alike is at the same epoch.

        The words are an exception's, which may name an address or a moment.
        """
        reasons: dict[int, set[Failure]] = {run: set() for run in block.runs if run < self._rows.runs}
        for failure in block.failures:
            if failure.run in reasons and failure.filter in ("", name):
                reasons[failure.run].add(failure)
        for run, found in reasons.items():
            before = self._known.setdefault((run, name), frozenset(found))
            if {(f.filter, f.epoch) for f in before} != {(f.filter, f.epoch) for f in found}:
                where = f"case {self._rows.case.label}, filter {name}"
                raise RefusedError(f"{info.path}: {where}: it disagrees with another shard about why run {run} failed")

    def in_order(self) -> list[Failure]:
        """Return the failures in the order of runs and filters."""
        order = {name: i for i, name in enumerate(self._rows.case.filters)}
        known = {failure for of_run in self._known.values() for failure in of_run}
        return sorted(known, key=lambda f: (f.run, order.get(f.filter, -1), f.epoch, f.reason))
