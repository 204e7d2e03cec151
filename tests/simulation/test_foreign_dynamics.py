"""Dynamics of other people that go wrong: one sentence, in the results of their own filter alone."""

from typing import ClassVar, Literal

import numpy as np
import pytest

from relnav_sim import register_dynamics
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.dynamics import registry
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.dynamics_inputs import SharedThings


class Wrong:
    """Clohessy and Wiltshire's motion, of which one part is wrong."""

    def __init__(self, context, **wrong):
        self._right = CwOptions().build(context)
        self.dimension, self.linear = wrong.pop("dimension", 6), True
        self._wrong = wrong

    def propagate(self, states, step):
        return self._wrong.get("propagate", self._right.propagate)(states, step)

    def transition(self, mean, step):
        return self._wrong.get("transition", self._right.transition)(mean, step)

    def process_noise(self, states, step):
        return self._wrong.get("process_noise", self._right.process_noise)(states, step)


def writes(states, step):
    states[:] = 0
    return states


def build_raises(context):
    raise RuntimeError("no table for this orbit")


WRONG = {
    "build": (build_raises, r"RuntimeError: no table for this orbit \(test_foreign_dynamics.py:\d+\)"),
    "nothing": (lambda context: None, "returned NoneType, which lacks dimension, linear, propagate"),
    "states": (lambda context: Wrong(context, dimension=4), "returned dynamics of 4 states; it must be 6"),
    "shape": (
        lambda context: Wrong(context, transition=lambda mean, step: np.eye(5)),
        r"transition of Wrong returned shape \(5, 5\) for states \(2, 6\); it must be \(6, 6\) or \(2, 6, 6\)",
    ),
    "writes": (lambda context: Wrong(context, propagate=writes), "propagate of Wrong writes into its argument"),
}


def options(build, name="foreign", needed=()):
    class ForeignOptions(DynamicsOptions):
        """Foreign dynamics."""

        needs: ClassVar = frozenset(needed)
        kind: Literal[name] = name

        def build(self, context):
            return build(context)

    return ForeignOptions


@pytest.fixture
def simulated(make_campaign, monkeypatch):
    def run(model, filters="{kind: ekf, dynamics: {kind: foreign}}", **changes):
        registry.dynamics_kinds()
        monkeypatch.setattr(registry, "_KINDS", dict(registry._KINDS))
        register_dynamics("foreign", model)
        text = make_campaign().text
        text = text[: text.index("filters:")] + f"filters:\n  right: {{kind: ekf}}\n  wrong: {filters}\n"
        sets = ["clock.duration_s=20", "statistics.settle_s=10", *(f"{key}={value}" for key, value in changes.items())]
        return simulate_block(parse_campaign(text, sets).cases[0], 1, [0, 1])

    return run


@pytest.mark.parametrize("case", WRONG)
def test_it_is_named_in_one_sentence_and_costs_its_own_filter_only(simulated, case):
    build, words = WRONG[case]
    outcome = simulated(options(build))
    assert set(outcome.broken) == {"wrong"} and set(outcome.result.filters) == {"right"}
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(outcome.broken["wrong"].reason)
    assert "\n" not in outcome.broken["wrong"].reason


def test_nan_is_a_failure_of_every_run_that_names_the_function(simulated):
    outcome = simulated(options(lambda context: Wrong(context, propagate=lambda states, step: states * np.nan)))
    assert not outcome.broken
    failures = outcome.result.failures
    assert {(each.run, each.filter, each.epoch) for each in failures} == {(0, "wrong", 1), (1, "wrong", 1)}
    assert all("propagate" in each.reason for each in failures), failures


def test_dynamics_that_need_fixes_must_be_fed(simulated):
    broken = simulated(options(Wrong, needed=["chief_fixes"])).broken["wrong"]
    assert "returned Wrong, which lacks feed, with_chief; it must have dimension, linear" in broken.reason


class Fed(Wrong):
    """Remembers what arrives."""

    def __init__(self, context):
        super().__init__(context)
        self.context, self.arrived = context, []
        FED.append(self)

    def feed(self, arrival):
        self.arrived.append(arrival)

    def with_chief(self, chief, first_epoch):
        return self


FED: list[Fed] = []


def test_what_is_needed_arrives_before_it_is_filtered(simulated):
    FED.clear()
    outcome = simulated(options(Fed, needed=["chief_fixes", "known_thrust"]), **{"clock.duration_s": 600})
    assert not outcome.broken and not outcome.result.failures
    (fed,) = FED
    assert fed.context.chief_fixes.runs == 2 and fed.context.chief_fixes.sigmas.shape == (6,)
    assert [each.first_epoch for each in fed.arrived] == [0, 512]
    assert [each.chief_fixes.shape for each in fed.arrived] == [(2, 512, 6), (2, 89, 6)]
    assert all(each.forces is None for each in fed.arrived)  # there is no thrust


def test_who_declares_no_need_gets_nothing(simulated):
    def build(context):
        assert context.chief_fixes is None
        with pytest.raises(ValueError, match="say training_track in `needs`"):
            context.learn(lambda track: track)
        return CwOptions().build(context)

    assert not simulated(options(build)).broken


def test_what_is_shared_is_made_once_and_by_name():
    things, made = SharedThings(), []

    class Slow:
        cpu_s = 2.0

    def make():
        made.append(Slow())
        return made[-1]

    assert things.of("chief", make) is things.of("chief", make)
    assert things.of("other", make) is made[1] and len(made) == 2
    assert things.cpu_s == 4.0


def test_registration_is_refused_in_words(monkeypatch):
    registry.dynamics_kinds()
    monkeypatch.setattr(registry, "_KINDS", dict(registry._KINDS))
    with pytest.raises(ValueError, match="dynamics named 'cw' are registered already"):
        register_dynamics("cw")(options(Wrong, "cw"))
    with pytest.raises(ValueError, match=r'registered as .other.; give it kind: Literal\["other"\] = "other"'):
        register_dynamics("other", options(Wrong))
    with pytest.raises(ValueError, match=r"need 'chief_fix', which doesn't exist; .*did you mean 'chief_fixes'"):
        register_dynamics("foreign", options(Wrong, needed=["chief_fix"]))
    with pytest.raises(TypeError, match="no subclass of DynamicsOptions"):
        register_dynamics("foreign", dict)
    assert "foreign" not in registry.dynamics_kinds()
    model = options(Wrong)
    assert register_dynamics("foreign", model) is model is register_dynamics("foreign")(model)
