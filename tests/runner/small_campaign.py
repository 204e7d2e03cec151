"""A campaign small enough to run many times, and how to compare results."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relnav_sim.results import layout, open_results

TEXT = """
name: small
seed: 5
runs: 6
block_runs: 4
clock: {duration_s: 40, step_s: 1, store_every_s: 4}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
    drag_coefficient: 2.2
  dispersions:
    relative_position: {kind: normal, sigma_m: 50}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
statistics: {settle_s: 10, convergence_hold_s: 20}
filters:
  kf: {kind: kf}
  ekf: {kind: ekf}
grid:
  sensors.radar.noise: [{kind: gaussian}, {kind: mixture, scale: 5, fraction: 0.1}]
"""


def data_of(path: Path) -> dict[tuple, np.ndarray]:
    """Return everything in a results file but measured times, by case id, filter and dataset."""
    found = {}
    with open_results(path) as results:
        for index, case in enumerate(results.headers):
            found[case.id, "", "truth"] = np.asarray(results.truth(index))
            for name in (None, *case.filters):
                if (bound := results.bound(index, name)) is not None:
                    found[case.id, name or "", "bound"] = bound
            for name in case.filters:
                runs = results.case_runs(index, name)
                found[case.id, name, "runs"] = np.asarray(runs)
                for spec in layout.SUMMARY:
                    if not spec.timing:
                        found[case.id, name, spec.name] = results.statistic(index, name, spec.name)
                for key, values in results.diagnostics(index, name).items():
                    found[case.id, name, f"diagnostic {key}"] = values
                extra = results.augmented(index, name)
                for part in ("estimate", "error", "sigma", "mean", "rms") if extra is not None else ():
                    found[case.id, name, f"extra {part}"] = getattr(extra, part)
                for series in ("error", "sigma", "nis", "nees"):
                    found[case.id, name, series] = np.asarray(getattr(results, series)(index, name))
        found["failures"] = np.array([str(failure) for failure in results.failures()])
    return found


def assert_same_bits(a: Path, b: Path) -> None:
    first, second = data_of(a), data_of(b)
    assert first.keys() == second.keys()
    for key, array in first.items():
        assert array.tobytes() == second[key].tobytes(), f"{key} differs"
