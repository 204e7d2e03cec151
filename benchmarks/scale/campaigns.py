"""Campaigns that are large in one direction and tiny in the others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isqrt

FILTER = "{kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: %r}}"


@dataclass(frozen=True)
class Size:
    """How large a campaign is."""

    runs: int = 4
    cases: int = 1
    filters: int = 1
    epochs: int = 31
    stored: int = 0
    """Stored points beside the first; 0: every third epoch, of more than 1000 epochs a hundred."""

    def along(self, axis: str, value: int) -> Size:
        """Return the size with another value along an axis, whose last word says of what."""
        return replace(self, **{axis.split()[-1]: value})


AXES = {
    "runs": (Size(), (10, 100, 1000, 10_000, 100_000)),
    "cases": (Size(), (10, 100, 1000, 5000, 10_000)),
    "full cases": (Size(runs=100, filters=6, epochs=121, stored=120), (1, 8, 60)),
    "filters": (Size(), (1, 10, 50, 200)),
    "epochs": (Size(runs=1), (1000, 10_000, 100_000, 1_000_000)),
    "stored": (Size(epochs=10_001), (10, 100, 1000, 10_000)),
}
"""The size from which each axis is varied, and its values."""


def text(size: Size) -> str:
    """Return the campaign file."""
    columns = next(n for n in range(isqrt(size.cases), 0, -1) if size.cases % n == 0)
    ranges = [round(1 + 0.01 * i, 4) for i in range(columns)]
    angles = [round(0.01 + 0.001 * i, 5) for i in range(size.cases // columns)]
    steps = size.epochs - 1
    store = steps // size.stored if size.stored else 3 if steps <= 1000 else steps // 100
    filters = "\n".join(f"  ekf_{i}: {FILTER % (1e-6 * (1 + i))}" for i in range(size.filters))
    grid = f"grid:\n  sensors.radar.range_sigma_m: {ranges}\n  sensors.radar.angle_sigma_deg: {angles}\n"
    return f"""name: scale
seed: 1
runs: {size.runs}
clock: {{duration_s: {steps - steps % store}, step_s: 1, store_every_s: {store}}}
truth:
  chief:
    orbit: {{a_km: 7000, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}}
    mass_kg: 500
    area_m2: 2
    drag_coefficient: 2.2
  deputy:
    relative: {{position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}}
    mass_kg: 500
    area_m2: 2
    drag_coefficient: 2.2
  forces: {{zonals: 2}}
sensors:
  radar: {{range_sigma_m: 4, angle_sigma_deg: 0.07}}
  gnss: {{position_sigma_m: 10, velocity_sigma_m_s: 0.05}}
  star_tracker: {{cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}}
start: {{kind: first_fix, velocity_sigma_m_s: 0.5}}
statistics: {{settle_s: 10}}
filters:
{filters}
{grid if size.cases > 1 else ""}"""
