"""What is kept of each campaign's results: the columns that rules and tables ask for, and the curves of the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

CurveKind = Literal["errors", "sigmas", "norms", "plane", "boxes"]

MEANS = ("settled_r_mean_m", "settled_r_std_m", "settled_v_mean_m_s", "settled_v_std_m_s")
RMS = ("settled_r_rms_m", "settled_v_rms_m_s")
AXES = tuple(
    f"settled_{axis}_{which}_{'m_s' if axis.startswith('v') else 'm'}"
    for axis in ("x", "y", "z", "vx", "vy", "vz")
    for which in ("mean", "std")
)
WHOLE = ("r_mean_m", "v_mean_m_s")
TIMES = ("convergence_relative_s", "convergence_s", "convergence_final_s")
OUTLIERS = ("outliers_r", "outliers_v")
WAVE = ("wave_period_s",)
WINDOWS = (1000.0, 1500.0, 2000.0, 3000.0, 4000.0, 6000.0)
"""Ends of the windows in which the particle filter's largest error is looked at, s."""
LARGEST = tuple(f"r_max_from_{start:.0f}_m" for start in WINDOWS[:-1])
PERSISTENCE = ("r_persistence", "v_persistence", "v_rms_late_m_s")
QUANTILES = ("settled_r_p95_m", "settled_v_p95_m_s", "settled_r_max_m", "settled_v_max_m_s")


@dataclass(frozen=True)
class Columns:
    """Columns kept of the named filters; of all where none is named."""

    names: tuple[str, ...]
    filters: tuple[str, ...] = ()


@dataclass(frozen=True)
class Curves:
    """Curves kept of one case: of which filters, and of every how many stored epochs."""

    kind: CurveKind
    filters: tuple[str, ...]
    case: int = 0
    every: int = 1


_THREE = ("ekf", "ukf", "alpha_kf")
_IMPLIED = tuple(f"{name}_implied" for name in _THREE)
_PUBLISHED = (Columns((*MEANS, *RMS, *WHOLE, *TIMES)), Columns((*AXES, *WAVE), (*_THREE, *_IMPLIED)))
_ERRORS = (Curves("errors", _THREE, every=3),)
_SWEPT = tuple(f"alpha_{alpha}" for alpha in ("0.001", "0.005", "0.01", "0.05", "0.1", "0.5", "0.999"))

COLUMNS: Mapping[str, Sequence[Columns]] = {
    "alpha_kf_gaussian": (*_PUBLISHED, Columns(("diagnostic_alpha",), ("adaptive_alpha",))),
    "alpha_kf_mixture": (*_PUBLISHED, Columns(("diagnostic_alpha",), ("adaptive_alpha",))),
    "alpha_kf_tuned": (Columns((*MEANS, *TIMES)),),
    "alpha_kf_orbit": (Columns((*MEANS, *TIMES, "settled_x_mean_m", "settled_x_std_m", *WAVE)),),
    "alpha_kf_process_noise": (Columns((*MEANS, "settled_x_mean_m")),),
    "alpha_kf_geometry": (Columns((*MEANS, *TIMES)),),
    "alpha_kf_attitude": (Columns((*MEANS, *TIMES)),),
    "alpha_kf_epsilon": (Columns(MEANS),),
    "alpha_kf_sweep": (
        Columns((*MEANS, *RMS, *OUTLIERS)),
        Columns(("diagnostic_alpha",), ("adaptive_alpha",)),
    ),
    "alpha_kf_sweep_tuned": (Columns((*MEANS, *OUTLIERS)),),
    "alpha_kf_bias": (Columns((*MEANS, *OUTLIERS)),),
    "alpha_kf_draws": (Columns((*MEANS, *RMS, *OUTLIERS)),),
    "alpha_kf_start": (Columns(("sigma_r_first_m", "sigma_r_last_m", "sigma_r_ratio", *TIMES)),),
    "limit": (Columns((*MEANS, *RMS)),),
    "mf_upf": (Columns((*RMS, *QUANTILES)),),
    "mf_upf_particles": (Columns((*RMS, *QUANTILES)),),
    "mf_upf_size": (Columns((*RMS, *QUANTILES)),),
    "mf_upf_depletion": (Columns((*RMS, *QUANTILES, *LARGEST, *PERSISTENCE)),),
    "two_step": (Columns(("convergence_s", "r_rms_m", "settled_r_rms_m")),),
}
"""Columns by campaign. Those that `Results.summary` does not have are made by `derived`."""

CURVES: Mapping[str, Sequence[Curves]] = {
    "alpha_kf_gaussian": _ERRORS,
    "alpha_kf_mixture": _ERRORS,
    "alpha_kf_start": (
        Curves("errors", _THREE, every=4),
        Curves("sigmas", (*_THREE, "ukf_quiet"), every=4),
    ),
    "alpha_kf_sweep": (Curves("boxes", _SWEPT),),
    "mf_upf_depletion": (
        Curves("norms", ("pf", "pf_50", "pf_tuned", "ekf_tuned")),
        Curves("norms", ("open_loop",), case=2),
    ),
    "mf_upf_particles": (
        Curves("norms", ("gp_particle_absolute_truth", "mf_upf_absolute_truth", "mf_upf_residual_radar", "pf")),
        Curves("plane", ("gp_particle_absolute_truth", "mf_upf_residual_radar", "pf_no_roughening")),
    ),
    "two_step": (
        Curves("norms", ("two_step_unscented", "two_step_linearised", "ekf", "ukf", "iekf", "kf"), case=3, every=2),
    ),
}
"""Curves by campaign."""
