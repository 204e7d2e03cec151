"""The datasets of a results file about the editing of measurements."""

from __future__ import annotations

from relnav_sim.results.dataset import Dataset

EDITING = (
    Dataset(
        "edit_tests", ("run", "span", "edited"), "<i8", "1",
        "tests of the sensor's measurements: one for each, or with scope channel one for each channel present",
        "{span}edit_tests_{sensor}",
    ),
    Dataset(
        "edit_rejected", ("run", "span", "edited"), "<i8", "1", "rejected measurements, or channels, of the sensor",
        "{span}edit_rejected_{sensor}",
    ),
    Dataset(
        "edit_lock_outs", ("run", "edited"), "<i8", "1",
        "lock-outs of the sensor, or of its channels: max_rejects rejections in a row", "edit_lock_outs_{sensor}",
    ),
    Dataset(
        "edit_actions", ("run", "edited"), "<i8", "1",
        "measurements of the sensor at which the filter's action was taken: accepted, inflated or restarted",
        "edit_actions_{sensor}",
    ),
    Dataset(
        "edit_recoveries", ("run",), "<i8", "1",
        "times that the filter recovered from lock-outs: NEES inside its 99.9 % quantile and no sensor locked out for "
        "10 max_rejects epochs in a row", "edit_recoveries",
    ),
    Dataset(
        "edit_recovery", ("run",), "<f8", "s",
        "longest time to recover, from the first of the rejections to the first of those epochs; NaN: no recovery",
        "edit_recovery_s",
    ),
    Dataset(
        "edit_lost", ("run",), "<i8", "1",
        "times that the filter diverged: NEES above its 99.9 % quantile for 10 max_rejects epochs in a row",
        "edit_lost",
    ),
    Dataset(
        "edit_open", ("run",), "<f8", "s",
        "time since the first of the rejections, where the run ends before the filter has recovered; NaN: none",
        "edit_open_s",
    ),
    Dataset(
        "edit_earliest", ("run",), "<f8", "s",
        "shortest time to recover that a run leaves possible which ends before the filter has recovered; NaN: it does "
        "not", "edit_earliest_s",
    ),
    Dataset(
        "edit_end", ("run",), "|i1", "1",
        "how the run ends: 0 recovered or never locked out; 1 measurements still rejected; 2 measurements pass and the "
        "estimate is off the truth (a fault adopted); 3 inside, for too short to count as recovered; 4 failed",
        "edit_end",
    ),
)  # fmt: skip
"""Only where the filter's entry has editing."""
