"""What Shi et al. (2025) leave open, and how likely each value is held to be before any printed number is looked at."""

from __future__ import annotations

from replication.inverse.prior import Unknown, choice, log_uniform, or_else, uniform

SHARING = ("one for all", "one for each filter", "one for each filter and table")
LABELS = {"ekf": "EKF", "ukf": "UKF", "alpha_kf": "alpha filter"}
COLUMNS = {
    f"{name}_{table}": f"{LABELS[name]} of Table {table}"
    for table, names in ((2, LABELS), (3, LABELS), (4, ("alpha_kf",)))
    for name in names
}
"""The filters of Tables 2, 3 and 4 that may each have a process noise of their own."""

ORBIT = (
    Unknown("period_s", "s", "the chief's period", uniform(5700, 6300)),
    Unknown("eccentricity", "", "the chief's eccentricity", or_else(0.2, 0.0, log_uniform(1e-4, 3e-2)), True),
    Unknown("inclination_deg", "deg", "the chief's inclination", uniform(0.5, 110)),
    Unknown(
        "latitude_argument_deg", "deg", "the chief's argument of latitude at the start", uniform(0, 360), wraps=True
    ),
    Unknown("true_anomaly_deg", "deg", "the chief's true anomaly at the start", uniform(0, 360), wraps=True),
)
DIRECTION = (
    Unknown("ahead", "", "the deputy", choice((1, 1)), choices=("behind", "ahead")),
    Unknown(
        "in_plane_share",
        "",
        "the share of the 12 km that is an ellipse in the orbit plane",
        or_else(0.5, 0.0, uniform(0, 1)),
    ),
    Unknown("in_plane_phase_deg", "deg", "the phase of that ellipse", uniform(0, 360), wraps=True),
    Unknown("cross_share", "", "the share of the 12 km that is across the plane", or_else(0.5, 0.0, uniform(0, 1))),
    Unknown("drift_m", "m", "the drift along the track in a revolution", or_else(0.5, 0.0, uniform(-1000, 1000))),
    Unknown("cross_phase_deg", "deg", "the phase of the oscillation across the plane", uniform(0, 360), wraps=True),
)
READINGS = (
    Unknown("sigma_interpretation", "", "what Table 1 lists", choice((3, 1)), choices=("3 sigma", "1 sigma")),
    Unknown(
        "attitude_tau_s",
        "s",
        "the correlation time of attitude and orbit errors",
        or_else(0.5, 0.0, log_uniform(1, 3000)),
        True,
    ),
    Unknown(
        "boresight", "", "the star tracker's axis", choice((1, 1, 1)), choices=("radial", "along-track", "cross-track")
    ),
    Unknown(
        "tracker_labels",
        "",
        "the order of the tracker's 30 and 100 arcsec",
        choice((1, 1)),
        choices=("as trackers are", "as printed"),
    ),
    Unknown("mixture_share", "", "the mean share of component B", or_else(0.5, 0.5, uniform(0, 1))),
    Unknown("bias_channel", "", "the angle with the bias", choice((1, 1, 1)), choices=("both", "azimuth", "elevation")),
    Unknown("azimuth_sign", "", "the azimuth bias's sign", choice((1, 1)), choices=("+", "-")),
    Unknown("elevation_sign", "", "the elevation bias's sign", choice((1, 1)), choices=("+", "-")),
    Unknown("bias_interpretation", "", "what 0.05 deg is", choice((3, 1)), choices=("the bias", "3 sigma of it")),
)
FILTERS = (
    Unknown("told_r", "", "the filters' R over the radar's", or_else(0.5, 1.0, log_uniform(0.1, 10)), True),
    Unknown("told_shape", "", "the filters' R", choice((3, 1)), choices=("as the radar's", "the same on all axes")),
    Unknown(
        "told_mixture",
        "",
        "the filters' R with mixture noise",
        choice((1, 1)),
        choices=("component A's", "the mixture's"),
    ),
    Unknown(
        "start_position", "", "the first variance of positions over that of a measurement", log_uniform(0.1, 100), True
    ),
    Unknown("start_velocity_m_s", "m/s", "the first standard deviation of velocities", log_uniform(1e-3, 30), True),
    Unknown("draws", "", "the alpha filter's samples", choice((3, 1)), choices=("10000 drawn", "no scatter")),
    Unknown("sharing", "", "the process noise", choice((1, 1, 1)), choices=SHARING, divides=True),
    Unknown("position_noise", "", "a part of Q for positions", choice((1, 1)), choices=("no", "yes")),
    Unknown(
        "radial_noise",
        "",
        "the radial over the along-track process noise",
        or_else(0.5, 1.0, log_uniform(0.01, 100)),
        True,
    ),
    Unknown(
        "cross_noise",
        "",
        "the cross-track over the along-track process noise",
        or_else(0.5, 1.0, log_uniform(0.01, 100)),
        True,
    ),
    *(
        Unknown(f"acceleration_psd_{c}", "m^2/s^3", f"the process noise, {words}", log_uniform(1e-11, 1e-3), True)
        for c, words in COLUMNS.items()
    ),
    *(
        Unknown(f"velocity_psd_{c}", "m^2/s", f"its part for positions, {words}", log_uniform(1e-6, 1e-1), True)
        for c, words in COLUMNS.items()
    ),
)
STATISTICS = (
    Unknown("span_s", "s", "the start of the span of the tables", or_else(0.2, 0.0, log_uniform(20, 2000)), True),
    Unknown(
        "limit_kind",
        "",
        "what counts as converged",
        choice((1, 1)),
        choices=("a length", "a multiple of the steady-state RMS"),
    ),
    Unknown("limit_m", "m", "the limit of convergence as a length", log_uniform(1, 15), True),
    Unknown("limit_ratio", "", "the limit of convergence over the steady-state RMS", log_uniform(1.2, 6), True),
)

UNKNOWNS: tuple[Unknown, ...] = (*ORBIT, *DIRECTION, *READINGS, *FILTERS, *STATISTICS)

SEEN_BY = {
    "mixture_share": (3, 4),
    "told_mixture": (3, 4),
    **dict.fromkeys(("bias_channel", "azimuth_sign", "elevation_sign", "bias_interpretation"), (4,)),
    **dict.fromkeys(("limit_kind", "limit_m", "limit_ratio"), (2,)),
    **{f"{kind}_{c}": (int(c[-1]),) for kind in ("acceleration_psd", "velocity_psd") for c in COLUMNS},
}
"""Tables on which an unknown acts, of those that do not act on all."""
