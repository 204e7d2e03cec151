"""What has been recorded in flight, or by a simulation, and files hold: orbits and measurements."""

from relnav_sim.recorded.ephemeris import Ephemeris
from relnav_sim.recorded.errors import EphemerisError
from relnav_sim.recorded.load import load_ephemeris

__all__ = ["Ephemeris", "EphemerisError", "load_ephemeris"]
