"""The Earth's constants, the defaults of every truth; a campaign may override each of them."""

# WGS 84 (NIMA TR8350.2, 2000): gravitational parameter m^3/s^2, equatorial radius m, rotation rate rad/s.
MU_M3_S2 = 3.986004418e14
RADIUS_M = 6378137.0
ROTATION_RAD_S = 7.292115e-5

# EGM96 (Lemoine et al., NASA/TP-1998-206861), unnormalised zonal harmonics to nine digits.
J2 = 1.08262668e-3
J3 = -2.53265649e-6
J4 = -1.61962159e-6

# One layer of the CIRA-72 based exponential model in Vallado, Fundamentals of Astrodynamics and
# Applications, 4th ed., table 8-4: from 400 km.
BASE_ALTITUDE_M = 400e3
DENSITY_KG_M3 = 3.725e-12
SCALE_HEIGHT_M = 58.515e3
