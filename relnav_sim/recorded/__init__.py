"""Files of flown orbits: CCSDS OEM and CSV, read strictly and interpolated."""

from relnav_sim.recorded.ephemeris import Ephemeris
from relnav_sim.recorded.errors import EphemerisError
from relnav_sim.recorded.load import load_ephemeris

__all__ = ["Ephemeris", "EphemerisError", "load_ephemeris"]
