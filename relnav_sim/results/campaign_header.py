"""What a results file says of its campaign and its cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from relnav_sim.measurements.channel import Channel


@dataclass(frozen=True)
class CaseHeader:
    """A case as the results file knows it.

    Attributes:
        id: Hash of the case's content without its filters.
        label: Its values in words.
        variables: The swept values by their paths.
        filters: Names of its filters, in order.
        filter_ids: A hash of each filter's settings, by its name.
        channels: What a measurement of each sensor consists of, by the sensor's name; empty in files of relnav 0.1.
        stress: Name of the stress under which it was flown, of which no filter is told; empty: none.
        nominal: Id of the same case without the stress; empty where there is none.
    """

    id: str
    label: str
    variables: Mapping[str, Any]
    filters: tuple[str, ...]
    filter_ids: Mapping[str, str]
    channels: Mapping[str, tuple[Channel, ...]] = field(default_factory=dict)
    stress: str = ""
    nominal: str = ""


@dataclass(frozen=True)
class ReplayHeader:
    """The recorded measurements behind a result.

    Attributes:
        files: SHA-256 of each file of measurements, by its name as the user gave it.
        truth: What the estimates are scored against, in words.
        runs: Numbers of the recorded runs, ascending.
    """

    files: Mapping[str, str]
    truth: str
    runs: tuple[int, ...]

    @staticmethod
    def of_plain(stored: Mapping[str, Any]) -> ReplayHeader:
        """Return what plain data holds, as `dataclasses.asdict` makes it.

        Raises:
            ValueError: It is damaged.
        """
        files, truth, runs = (stored.get(name) for name in ("files", "truth", "runs"))
        if not isinstance(files, Mapping) or not all(isinstance(text, str) for text in (*files.values(), truth)):
            raise ValueError("the files or the truth are no text")
        whole = isinstance(runs, list | tuple) and all(type(run) is int and run >= 0 for run in runs)
        if not whole or not runs or sorted(set(runs)) != list(runs):
            raise ValueError("the runs are no ascending numbers")
        return ReplayHeader(dict(files), str(truth), tuple(runs))


@dataclass(frozen=True)
class ResultHeader:
    """The facts of a campaign that its results file carries.

    Attributes:
        campaign_name: Name of the campaign.
        text: The campaign file, word for word.
        content: Validated content with all defaults, fit for JSON.
        hash: Hash of the content that must not change between runs of one result.
        seed: Seed of the campaign.
        runs: Number of runs planned.
        cases: The cases in order.
        constants: Constants of the models by name (unit in the name), as attributes of ``/constants``.
        only: The single run that the file is to hold; None: all of the campaign's.
        stopping: The rule of adaptive stopping and what came of it; empty without one.
        replay: Where the measurements were recorded; None: they were simulated.
    """

    campaign_name: str
    text: str
    content: Mapping[str, Any]
    hash: str
    seed: int
    runs: int
    cases: tuple[CaseHeader, ...]
    constants: Mapping[str, float | int | str] = field(default_factory=dict)
    only: int | None = None
    stopping: Mapping[str, Any] = field(default_factory=dict)
    replay: ReplayHeader | None = None

    @property
    def planned(self) -> Sequence[int]:
        """Numbers of the runs that the file is to hold of every case and filter."""
        if self.replay is not None:
            return self.replay.runs
        return range(self.runs) if self.only is None else (self.only,)
