"""A sensor is tried once, and again wherever another one could be meant: of another class, or with other options."""

import numpy as np
from pydantic import Field
from some_sensors import RangedOptions

from relnav_sim.sensors.conformity import complaints


class Flat(RangedOptions):
    """The rangefinder, without the axis of channels."""

    def sample(self, truth, streams):
        return super().sample(truth, streams)[..., 0]


class Tabled(RangedOptions):
    """A rangefinder with a table that it can't be hashed by."""

    table: dict[str, float] = Field(default_factory=dict)

    def sample(self, truth, streams):
        z = super().sample(truth, streams)
        return z if self.table else z[..., 0]


def said(options):
    return list(complaints("one", {"one": options}, 1.0))


def test_each_is_judged_by_itself():
    flat = [
        "sample of the ranged sensor returned shape (2, 3); expected (runs, K, 1), here (2, 3, 1), for its channels"
    ]
    for _ in range(2):
        assert (said(RangedOptions()), said(Flat())) == ([], flat)
        assert (said(Tabled(table={"a": 1.0})), said(Tabled())) == ([], flat)


def test_the_same_options_are_tried_once(monkeypatch):
    tried = []
    monkeypatch.setattr(Flat, "sample", lambda self, truth, streams: tried.append(self) or np.zeros(1))
    assert said(Flat(period_s=7.0)) == said(Flat(period_s=7.0)) != []  # as in no other test
    assert len(tried) == 1
