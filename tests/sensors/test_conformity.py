"""A sensor is judged by itself, however much another one is like it: of another class, or with other options."""

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
