"""The curves that the figures draw, taken from a results file."""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.results.read import Results
from replication.kept import Curves

_DRAWN_OUTLIERS = 40


def curves_of(results: Results, wanted: Curves) -> dict[str, Any]:
    """Return curves as plain data: ``kind``, ``time_s`` and ``filters``, by name.

    Args:
        results: Open results.
        wanted: Which curves.

    Raises:
        ResultsError: The file holds no such case or filter.
    """
    epochs = slice(None, None, wanted.every)
    made = {"errors": _errors, "sigmas": _sigmas, "norms": _norms, "plane": _plane, "boxes": _boxes}[wanted.kind]
    return {
        "kind": wanted.kind,
        "time_s": results.time_s(wanted.case)[epochs].tolist() if wanted.kind != "boxes" else [],
        "filters": {
            name: {key: _short(value) for key, value in made(results, wanted.case, name, epochs).items()}
            for name in wanted.filters
            if name in results.filters
        },
    }


def _short(values: Array) -> Any:
    """Return values with four digits, which no figure shows more of."""
    return np.vectorize(lambda value: float(f"{value:.4g}"), otypes=[float])(values).tolist() if values.size else []


def _errors(results: Results, case: int, filter: str, epochs: slice) -> dict[str, Array]:
    """Run 0 and where 95 % of the runs are at each epoch, RTN (K, 6)."""
    error = results.error(case, filter)[:, epochs]
    low, high = np.nanquantile(error, (0.025, 0.975), axis=0)
    return {"first": error[0], "low": low, "high": high}


def _sigmas(results: Results, case: int, filter: str, epochs: slice) -> dict[str, Array]:
    """Formal standard deviations of run 0, RTN (K, 6)."""
    return {"sigma": results.sigma(case, filter)[0, epochs]}


def _norms(results: Results, case: int, filter: str, epochs: slice) -> dict[str, Array]:
    """Median of |error| over runs and where 90 % of them are, (K,) each; r in m, v in m/s."""
    error = results.error(case, filter)[:, epochs]
    kept: dict[str, Array] = {}
    for name, part in (("r", slice(0, 3)), ("v", slice(3, 6))):
        norm = np.linalg.norm(error[..., part], axis=-1)
        low, middle, high = np.nanquantile(norm, (0.05, 0.5, 0.95), axis=0)
        kept |= {f"{name}_low": low, f"{name}_median": middle, f"{name}_high": high}
    return kept


def _plane(results: Results, case: int, filter: str, epochs: slice) -> dict[str, Array]:
    """True and estimated position of run 0 in the orbit plane, radial and along-track (K, 2)."""
    series = results.series(case, filter, int(results.case_runs(case, filter)[0]))
    truth = series.truth[epochs, :2]
    return {"truth": truth, "estimate": truth + series.error[epochs, :2]}


def _boxes(results: Results, case: int, filter: str, epochs: slice) -> dict[str, Array]:
    """Box plot of |error| in the steady state, all runs: ends and box with median (5,), outliers thinned out evenly."""
    settled = results.time_s(case) >= results.campaign_content["statistics"]["settle_s"]
    kept = {}
    for name, part in (("r", slice(0, 3)), ("v", slice(3, 6))):
        norm = np.sort(np.linalg.norm(results.error(case, filter)[:, settled, part], axis=-1).ravel())
        low, middle, high = np.quantile(norm, (0.25, 0.5, 0.75))
        reach = 1.5 * (high - low)
        inside = norm[(norm >= low - reach) & (norm <= high + reach)]
        outside = norm[(norm < low - reach) | (norm > high + reach)]
        places = np.unique(np.linspace(0, len(outside) - 1, min(len(outside), _DRAWN_OUTLIERS)).astype(int))
        kept[name] = np.array([inside[0], low, middle, high, inside[-1]])
        kept[f"{name}_outliers"] = outside[places] if len(outside) else outside
    return kept
