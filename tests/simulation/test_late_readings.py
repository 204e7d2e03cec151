"""Measurements that arrive late: what a filter that goes back for them says, beside one that has had them in order."""

import numpy as np
import pytest
from small_campaign import TEXT

from relnav_sim import CampaignError, load_campaign
from relnav_sim.simulation.block import filter_block, simulate_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource

# Two late sensors, and a burn over the border of a chunk.
PARTS = ("mean", "covariance", "nis")
BURN = "manoeuvres: {burn: {time_s: 44, duration_s: 12, delta_v_m_s: [0, 0.2, 0]}}"
CAMERA = "camera: {angle_sigma_deg: 0.05, period_s: 2"
ACCELEROMETER = "accelerometer: {bias_sigma_m_s2: 1.0e-3, velocity_random_walk_m_s_sqrt_s: 1.0e-4}"
START = "start: {kind: dispersed, position_sigma_m: 50, velocity_sigma_m_s: 0.2}"


def campaign(tmp_path, filters, late=True, drawn="drawn_latency_s: [0, 2.5]", more="", duration_s=130):
    drawn = f", {drawn}}}" if late else "}"
    text = (
        TEXT[: TEXT.index("filters:")]
        .replace("duration_s: 40", f"duration_s: {duration_s}")
        .replace("store_every_s: 4", "store_every_s: 1")
        .replace("  dispersions:", f"  {BURN}\n  dispersions:")
        .replace("sigma_deg: 0.1}", f"sigma_deg: 0.1, noise: {{kind: gaussian}}{drawn}\n  {CAMERA}{drawn}\n  {more}")
    )
    path = tmp_path / "late.yaml"
    entries = "".join(f"  {name}: {{{entry}}}\n" for name, entry in filters.items())
    path.write_text(f"{text}{START}\nfilters:\n{entries}")
    return load_campaign(path)


class Watch:
    def __init__(self):
        self.histories = {}

    def __call__(self, name, filter, chunk, before, history):
        self.histories.setdefault(name, []).append(history)

    def afterwards(self, name, chunk, history):
        raise AssertionError("no row here is smoothed")


def estimates(found, runs=range(2)):
    """Return mean, covariance and NIS of every filter at every epoch, and the delays by sensor."""
    delays = []
    watch = Watch()
    case = found.cases[0]
    source = RandomSource(found.seed, tuple(runs))

    def arriving():
        for chunk in chunks(case.config, source):
            delays.append(chunk.delays)
            yield chunk

    outcome = filter_block(case, source, arriving(), watch=watch)
    assert not outcome.broken, outcome.broken
    joined = {
        name: {
            part: np.concatenate([getattr(one, part) for one in parts], axis=1)
            for part in ("mean", "covariance", "nis")
        }
        for name, parts in watch.histories.items()
    }
    return joined, {name: np.concatenate([each[name] for each in delays], axis=1) for name in delays[0]}


def outstanding(delays):
    """Return where a measurement of an epoch up to this one may not have arrived yet, (runs, T)."""
    missing = np.zeros_like(next(iter(delays.values())), dtype=bool)
    for delay in delays.values():
        for back in range(delay.max()):
            missing[:, back:] |= delay[:, : delay.shape[1] - back] > back
    return missing


FILTERS = {
    "ekf": "kind: ekf, dynamics: {kind: nonlinear_j2}",
    "particles": "kind: particle, particles: 20",
}


def test_it_is_the_filter_in_order_wherever_nothing_is_outstanding(tmp_path, monkeypatch):
    """To the bit, also over the border of a chunk, with a known burn and the chief's fixes, which are fed by chunks."""
    monkeypatch.setattr("relnav_sim.simulation.chunks.CHUNK_EPOCHS", 48)
    buffer = {name: f"{entry}, out_of_sequence: buffer" for name, entry in FILTERS.items()}
    late, delays = estimates(campaign(tmp_path, buffer))
    in_order, _ = estimates(campaign(tmp_path, FILTERS, late=False))
    missing = outstanding(delays)
    assert 0.02 < (~missing).mean() < 0.5
    assert (~missing)[:, 48:].any(), "both sides of the border are looked at"
    for name in FILTERS:
        for part in ("mean", "covariance"):
            was, now = in_order[name][part], late[name][part]
            assert np.array_equal(now[~missing], was[~missing]), (name, part)
            assert not np.array_equal(now[missing], was[missing])
        # The innovations are those in order, 2 epochs later, when the last measurement of an epoch has arrived.
        assert np.array_equal(late[name]["nis"][:, 3:], in_order[name]["nis"][:, 1:-2], equal_nan=True)


def test_a_bias_that_acts_while_pushed_is_gone_back_over_as_it_was(tmp_path, monkeypatch):
    """The dynamics of the chunk before keep their own forces: also where an augmented state asks for them."""
    monkeypatch.setattr("relnav_sim.simulation.chunks.CHUNK_EPOCHS", 48)
    entry = "kind: ekf, augment: [{kind: accelerometer_bias, sigma_m_s2: 1.0e-3}]"
    late, delays = estimates(campaign(tmp_path, {"row": f"{entry}, out_of_sequence: buffer"}, more=ACCELEROMETER))
    in_order, _ = estimates(campaign(tmp_path, {"row": entry}, late=False, more=ACCELEROMETER))
    missing = outstanding(delays)
    assert (~missing)[:, 48:].any()
    for part in ("mean", "covariance"):
        assert np.array_equal(late["row"][part][~missing], in_order["row"][part][~missing]), part


def test_dropped_readings_are_as_if_never_taken_and_a_smoother_has_them_all(tmp_path):
    rows = {"drop": "kind: ekf", "buffer": "kind: ekf, out_of_sequence: buffer"}
    late, delays = estimates(campaign(tmp_path, rows))
    read = np.isfinite(late["drop"]["nis"])
    # The camera reads every other epoch; epoch 0 belongs to the start.
    due = np.arange(read.shape[1]) % 2 == 0
    in_time = (delays["radar"] == 0) | ((delays["camera"] == 0) & due)
    assert np.array_equal(read[:, 1:], in_time[:, 1:])
    rows = {"row": "kind: ekf, smoother: rts"}
    plain, smoothed = (
        simulate_block(found.cases[0], found.seed, range(2)).result.filters["row"]
        for found in (campaign(tmp_path, rows, late=False), campaign(tmp_path, rows))
    )
    assert np.array_equal(plain.error, smoothed.error)


def test_a_run_has_the_same_bits_in_any_block(tmp_path):
    buffer = {name: f"{entry}, out_of_sequence: buffer" for name, entry in FILTERS.items()}
    found = campaign(tmp_path, buffer, duration_s=64)
    whole, part = (simulate_block(found.cases[0], found.seed, runs).result for runs in (range(3), range(1, 3)))
    for name in FILTERS:
        for series in ("error", "sigma", "nis"):
            own, other = (getattr(each.filters[name], series) for each in (whole, part))
            assert np.array_equal(own[1:], other, equal_nan=True)


REFUSED = {
    "drawn_latency_s: [1, 2.5]": "every measurement of radar arrives a step or more late",
    "drawn_latency_s: [2, 1]": "must be the shortest and the longest",
    "drawn_latency_s: [0, 2], latency_s: 1": "exclude each other",
}


@pytest.mark.parametrize("option", REFUSED)
def test_latencies_that_make_no_sense_are_refused(tmp_path, option):
    with pytest.raises(CampaignError, match=REFUSED[option]):
        campaign(tmp_path, {"row": "kind: ekf"}, drawn=option)


@pytest.mark.parametrize(
    "entry, said",
    [
        ("smoother: rts, out_of_sequence: drop", "what is known afterwards has had all measurements in order"),
        ("smoother: {fixed_lag: {lag_s: 2}}", "after the estimate; take a lag no shorter"),
        ("out_of_sequence: buffer, batch_start: {duration_s: 5}", "leave out batch_start"),
    ],
)
def test_what_a_filter_can_not_do_with_late_readings_is_refused(tmp_path, entry, said):
    with pytest.raises(CampaignError, match=said):
        campaign(tmp_path, {"row": f"kind: ekf, {entry}"})
