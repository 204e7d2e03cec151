"""What Shi et al. (2025) leave open, and how likely each value is held to be before any printed number is looked at."""

from __future__ import annotations

from replication.inverse.prior import Unknown, choice, log_uniform, or_else, uniform

SHARING = ("one for all", "one for each filter", "one for each filter and table")
COLUMNS = ("ekf_2", "ukf_2", "alpha_kf_2", "ekf_3", "ukf_3", "alpha_kf_3", "alpha_kf_4")
"""The filters of Tables 2, 3 and 4 that may each have a process noise of their own."""

ORBIT = (
    Unknown("period_s", "s", "period of the chief, about 6000 s", uniform(5700, 6300)),
    Unknown("eccentricity", "", "of the chief's orbit", or_else(0.2, 0.0, log_uniform(1e-4, 3e-2)), True),
    Unknown("inclination_deg", "deg", "of the chief's orbit", uniform(0.5, 110)),
    Unknown("latitude_argument_deg", "deg", "of the chief at the start", uniform(0, 360)),
    Unknown("true_anomaly_deg", "deg", "of the chief at the start", uniform(0, 360)),
)
DIRECTION = (
    Unknown("ahead", "", "whether the deputy leads", choice((1, 1)), choices=("behind", "ahead")),
    Unknown("in_plane_share", "", "of the 12 km that is an ellipse in the plane", or_else(0.5, 0.0, uniform(0, 1))),
    Unknown("in_plane_phase_deg", "deg", "of that ellipse", uniform(0, 360)),
    Unknown(
        "cross_share", "", "of the 12 km that is an oscillation across the plane", or_else(0.5, 0.0, uniform(0, 1))
    ),
    Unknown("drift_m", "m", "along the track in a revolution", or_else(0.5, 0.0, uniform(-1000, 1000))),
    Unknown("cross_phase_deg", "deg", "of that oscillation", uniform(0, 360)),
)
READINGS = (
    Unknown("sigma_reading", "", "how Table 1 is read", choice((3, 1)), choices=("3 sigma", "1 sigma")),
    Unknown("attitude_tau_s", "s", "correlation time of attitude and orbit errors", or_else(0.5, 0.0, log_uniform(1, 3000)), True),
    Unknown("boresight", "", "axis of the star tracker", choice((1, 1, 1)), choices=("radial", "along-track", "cross-track")),
    Unknown("tracker_labels", "", "whose the 30 and 100 arcsec are", choice((1, 1)), choices=("as trackers are", "as printed")),
    Unknown("mixture_share", "", "mean share of component B", or_else(0.5, 0.5, uniform(0, 1))),
    Unknown("bias_channel", "", "angle with the bias", choice((1, 1, 1)), choices=("both", "azimuth", "elevation")),
    Unknown("azimuth_sign", "", "sign of its bias", choice((1, 1)), choices=("+", "-")),
    Unknown("elevation_sign", "", "sign of its bias", choice((1, 1)), choices=("+", "-")),
    Unknown("bias_reading", "", "what 0.05 deg is", choice((3, 1)), choices=("the bias", "3 sigma of it")),
)  # fmt: skip
FILTERS = (
    Unknown("told_r", "", "R told over that of the radar", or_else(0.5, 1.0, log_uniform(0.1, 10)), True),
    Unknown("told_shape", "", "R told", choice((3, 1)), choices=("as the radar's", "the same on all axes")),
    Unknown("told_mixture", "", "R told with mixture noise", choice((1, 1)), choices=("component A's", "the mixture's")),
    Unknown("start_position", "", "P0 of the position over R told", log_uniform(0.1, 100), True),
    Unknown("start_velocity_m_s", "m/s", "P0 of the velocity, 1 sigma", log_uniform(1e-3, 30), True),
    Unknown("draws", "", "the alpha filter's samples", choice((3, 1)), choices=("10000 drawn", "no scatter")),
    Unknown("sharing", "", "process noise", choice((1, 1, 1)), choices=SHARING),
    Unknown("position_noise", "", "whether Q has a part of its own for positions", choice((1, 1)), choices=("no", "yes")),
    Unknown("radial_noise", "", "radial over along-track process noise", or_else(0.5, 1.0, log_uniform(0.01, 100)), True),
    Unknown("cross_noise", "", "cross-track over along-track process noise", or_else(0.5, 1.0, log_uniform(0.01, 100)), True),
    *(Unknown(f"acceleration_psd_{c}", "m^2/s^3", f"process noise, {c}", log_uniform(1e-11, 1e-3), True) for c in COLUMNS),
    *(Unknown(f"velocity_psd_{c}", "m^2/s", f"process noise on positions, {c}", log_uniform(1e-6, 1e-1), True) for c in COLUMNS),
)  # fmt: skip
STATISTICS = (
    Unknown("span_s", "s", "start of the span of the tables", or_else(0.2, 0.0, log_uniform(20, 2000)), True),
    Unknown("limit_kind", "", "converged is below", choice((1, 1)), choices=("a length", "a multiple of the settled RMS")),
    Unknown("limit_m", "m", "that length", log_uniform(1, 15), True),
    Unknown("limit_ratio", "", "that multiple", log_uniform(1.2, 6), True),
)  # fmt: skip

UNKNOWNS: tuple[Unknown, ...] = (*ORBIT, *DIRECTION, *READINGS, *FILTERS, *STATISTICS)
