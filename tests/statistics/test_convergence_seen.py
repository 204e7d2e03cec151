"""How late a run can be seen to converge, against the statistics of runs, and what a campaign is warned of."""

from pathlib import Path

import numpy as np
import pytest

from relnav_sim.campaign import load_campaign
from relnav_sim.statistics.convergence import Convergence
from relnav_sim.statistics.convergence_seen import convergence_warnings, hold_epochs, latest_convergence_s

CAMPAIGN = """
name: b
seed: 1
runs: 4
clock: {duration_s: 120, step_s: 1, store_every_s: 5}
truth:
  chief: {orbit: {a_km: 6878, e: 0.001, i_deg: 51.6}, mass_kg: 200, area_m2: 1}
  deputy: {relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}, mass_kg: 100, area_m2: 1}
sensors: {radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}}
statistics: {settle_s: 30}
filters: {ekf: {kind: ekf}}
"""


@pytest.mark.parametrize(
    ("duration_s", "step_s", "hold_s"), [(40, 1, 50), (50, 1, 50), (51, 1, 50), (60, 0.2, 50), (60, 7.5, 20), (3, 1, 0)]
)
def test_the_latest_time_is_that_of_a_run_that_gets_there_just_in_time(
    duration_s: float, step_s: float, hold_s: float
) -> None:
    epochs = round(duration_s / step_s)
    size = np.where(np.arange(epochs) < np.arange(epochs + 1)[:, None], 9.0, 0.0)  # row k: small from epoch k + 1 on
    seen = Convergence(epochs + 1, 1.0, hold_epochs(hold_s, step_s))
    seen.add(size)
    times = seen.below_threshold() * step_s
    latest = latest_convergence_s(duration_s, step_s, hold_s)
    assert (np.nanmax(times) == pytest.approx(latest)) if np.isfinite(times).any() else latest <= 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([], []),
        (["clock.duration_s=40"], ["the run of 40 s is not longer than"]),
        (["statistics.convergence_hold_s=120"], ["convergence cannot be judged"]),
        (["statistics.convergence_hold_s=100"], ["leaves 20 s of the run of 120 s"]),
        (["requirements.quick={kind: converged, within_s: 70, share: 0.5}"], []),
        (["requirements.quick={kind: converged, within_s: 71, share: 0.5}"], ["requirements.quick.within_s of 71 s"]),
    ],
)
def test_a_campaign_is_warned_where_its_runs_are_too_short(
    changes: list[str], words: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "b.yaml"
    text = CAMPAIGN
    for change in [change for change in changes if change.startswith("requirements")]:
        name, _, rule = change.removeprefix("requirements.").partition("=")
        text += f"requirements: {{{name}: {rule}}}\n"
    file.write_text(text)
    found = convergence_warnings(load_campaign(file, [c for c in changes if not c.startswith("requirements")]))
    assert len(found) == len(words) and all(word in sentence for word, sentence in zip(words, found, strict=True))
