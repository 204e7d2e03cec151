"""The table of augmented states against numbers worked out by hand."""

from dataclasses import replace

import numpy as np

from relnav_sim.plots.facts import case_facts
from relnav_sim.report.augmented_table import augmented_table
from relnav_sim.report.tables import Number
from relnav_sim.results import open_results
from relnav_sim.results.block import AugmentedStates


def test_errors_of_extra_states_in_the_units_of_campaigns(make_result) -> None:
    with open_results(make_result(filters={"ekf": 1.0, "kf": 1.0}, runs=3)) as results:
        case = case_facts(results, 0)
    assert augmented_table(case) is None
    error = np.zeros((3, 4, 2))
    sigma = np.full((3, 4, 2), [np.radians(0.5), 2e-6])
    rms = np.stack([np.full((3, 2), 99.0), np.radians([[0.1, 0.2], [0.2, 0.2], [0.3, 0.2]])], axis=1)
    mean = rms * [1, np.nan]
    extra = AugmentedStates(("azimuth_bias", "drag"), ("rad", "m/s^2"), error, error, sigma, mean, rms)
    first, second = case.filters
    ok = np.array([True, True, False])
    table = augmented_table(replace(case, filters=(replace(first, augmented=extra, ok=ok), second)))
    assert table is not None
    cells = {row.label: (row.unit, row.cells) for row in table.rows}
    unit, (found, other) = cells["azimuth_bias, rms error, steady state"]
    # The third run failed.
    assert unit == "deg" and isinstance(found, Number) and np.isclose(found.value, 0.15)
    assert not isinstance(other, Number) or np.isnan(other.value)
    unit, (found, _) = cells["drag, formal sigma at the end"]
    assert unit == "um/s^2" and isinstance(found, Number) and np.isclose(found.value, 2.0)
    unit, (found, _) = cells["drag, mean error, steady state"]
    assert not isinstance(found, Number) or np.isnan(found.value)
