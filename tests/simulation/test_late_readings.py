"""Readings that arrive late: what a filter that goes back for them says, beside one that has had them in order."""

import numpy as np
from small_campaign import TEXT

from relnav_sim import load_campaign
from relnav_sim.simulation.block import filter_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource

# More than one chunk of 512 epochs, in the middle of which a burn and a gap lie; several sensors, two of them late.
PARTS = ("mean", "covariance", "nis")
BURN = "manoeuvres: {burn: {time_s: 505, duration_s: 12, delta_v_m_s: [0, 0.2, 0]}}"
CAMERA = "camera: {angle_sigma_deg: 0.05, period_s: 2"
START = "start: {kind: dispersed, position_sigma_m: 50, velocity_sigma_m_s: 0.2}"


def campaign(tmp_path, filters, late=True):
    drawn = ", drawn_latency_s: [0, 2.5]}" if late else "}"
    text = (
        TEXT[: TEXT.index("filters:")]
        .replace("duration_s: 40", "duration_s: 540")
        .replace("store_every_s: 4", "store_every_s: 1")
        .replace("  dispersions:", f"  {BURN}\n  dispersions:")
        .replace("sigma_deg: 0.1}", f"sigma_deg: 0.1, noise: {{kind: gaussian}}{drawn}\n  {CAMERA}{drawn}")
    )
    path = tmp_path / "late.yaml"
    entries = "".join(f"  {name}: {{{entry}}}\n" for name, entry in filters.items())
    path.write_text(f"{text}{START}\nfilters:\n{entries}")
    return load_campaign(path)


def estimates(found, runs=range(2)):
    """Return mean, covariance and NIS of every filter at every epoch, and the delays by sensor."""
    histories, delays = {}, []
    case = found.cases[0]
    source = RandomSource(found.seed, tuple(runs))

    def watch(name, filter, chunk, before, history):
        histories.setdefault(name, []).append(history)

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
        for name, parts in histories.items()
    }
    return joined, {name: np.concatenate([each[name] for each in delays], axis=1) for name in delays[0]}


def outstanding(delays):
    """Return where a reading of an epoch up to this one may not have arrived yet, (runs, T)."""
    missing = np.zeros_like(next(iter(delays.values())), dtype=bool)
    for delay in delays.values():
        for back in range(delay.max()):
            missing[:, back:] |= delay[:, : delay.shape[1] - back] > back
    return missing


FILTERS = {
    "ekf": "kind: ekf, dynamics: {kind: nonlinear_j2}",
    "particles": "kind: particle, particles: 50",
    "student": "kind: student_t",
}


def test_it_is_the_filter_in_order_wherever_nothing_is_outstanding(tmp_path):
    """To the bit, also over the border of a chunk, with a known burn and the chief's fixes, which are fed by chunks."""
    buffer = {name: f"{entry}, out_of_sequence: buffer" for name, entry in FILTERS.items()}
    late, delays = estimates(campaign(tmp_path, buffer))
    in_order, _ = estimates(campaign(tmp_path, FILTERS, late=False))
    missing = outstanding(delays)
    assert 0.02 < (~missing).mean() < 0.5
    assert (~missing)[:, 512:].any(), "both sides of the border are looked at"
    for name in FILTERS:
        for part in ("mean", "covariance"):
            was, now = in_order[name][part], late[name][part]
            assert np.array_equal(now[~missing], was[~missing]), (name, part)
            assert not np.array_equal(now[missing], was[missing])
        # The innovations are those in order, 2 epochs later, when the last reading of an epoch has arrived.
        assert np.array_equal(late[name]["nis"][:, 3:], in_order[name]["nis"][:, 1:-2], equal_nan=True)
