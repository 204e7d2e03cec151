"""What measurements of a campaign's sensors look like in files, and what else a front end goes by."""

from __future__ import annotations

from relnav_sim.measurements.channel import Channel
from relnav_sim.recorded.readings import ReadingsError
from relnav_sim.sensors.campaign_sensors import Sensors, own_sensor, reading_names, relative_sensors
from relnav_sim.sensors.interface import ECI_STATE, Craft


def readings_layout(sensors: Sensors) -> dict[str, tuple[Channel, ...]]:
    """Return the numbers of the measurements that filters are given, by name, as `SensorSuite.measure` names them.

    Last come the orbits that count as known, ``chief_orbit`` or ``deputy_orbit``; see `known_orbits`.

    Args:
        sensors: The sensors of a campaign.

    Raises:
        ReadingsError: A sensor has the name of such an orbit.
    """
    layout = {reading: sensors[name].reading for reading, (name, _) in reading_names(sensors).items()}
    known = known_orbits(sensors).values()
    if taken := next((orbit for orbit in known if orbit in layout), None):
        raise ReadingsError(f"the campaign's sensor {taken} has the name that files give an orbit; rename the sensor")
    return layout | dict.fromkeys(known, ECI_STATE)


def known_orbits(sensors: Sensors) -> dict[Craft, str]:
    """Return the craft whose true orbits the front end goes by, with the names of these in files of measurements.

    They are hosts of sensors that read a direction, without a receiver or without a star tracker where they need it:
    such a host knows its orbit or its attitude in the LVLH frame perfectly, and a recording must hold the orbit in
    which it does.

    Args:
        sensors: The sensors of a campaign.
    """
    relative = relative_sensors(sensors).values()
    hosts: tuple[Craft, ...] = ("chief", "deputy")
    return {
        host: f"{host}_orbit"
        for host in hosts
        if any(
            any(each.needs_direction())
            and _goes_by_truth(
                own_sensor(sensors, "orbit", host) is not None,
                own_sensor(sensors, "attitude", host) is not None,
                "attitude" in each.direction_from,
            )
            for each in relative
            if each.host == host
        )
    }


def _goes_by_truth(receiver: bool, tracker: bool, turns_with_body: bool) -> bool:
    """Return whether a sensor's frame follows from the true orbit.

    With neither receiver nor tracker, body and orbit frame are one: no orbit is needed to go from one to the other.
    """
    if not turns_with_body:
        return not receiver
    return receiver != tracker
