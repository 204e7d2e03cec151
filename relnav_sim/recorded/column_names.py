"""Names of columns: what a CSV file of measurements calls the times, and the channels of sensors with their units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from relnav_sim.near_names import nearest
from relnav_sim.recorded.readings import Layout, Quantity, ReadingsError, quoted
from relnav_sim.recorded.units import ending, factors
from relnav_sim.wording import listed

TIME_COLUMNS = {"time_s": None, "time_utc": "UTC", "time_gps": "GPS", "time_tai": "TAI", "time_tt": "TT"}
"""The columns of time, and the time scales of those that hold calendar dates."""
_SCALES = TIME_COLUMNS | {"utc_time": "UTC", "gps_time": "GPS", "tai_time": "TAI", "tt_time": "TT"}
"""The same with other common names."""


@dataclass(frozen=True)
class Place:
    """A column of the file that is a channel of a sensor: which one, and what its unit is in SI."""

    sensor: str
    channel: int
    factor: float


def column_name(sensor: str, quantity: Quantity) -> str:
    """Return the name of the column that holds a channel in SI units."""
    unit = ending(quantity.unit)
    return f"{sensor}.{quantity.name}_{unit}" if unit else f"{sensor}.{quantity.name}"


def time_column(where: str, names: Sequence[str]) -> tuple[int, str | None]:
    """Return which column holds the time, and the time scale of its calendar dates; None: it holds seconds.

    Args:
        where: The header's file and line, for messages.
        names: The names of all columns.

    Raises:
        ReadingsError: None holds it, or several do.
    """
    found = [index for index, name in enumerate(names) if name in _SCALES]
    if len(found) == 1:
        return found[0], _SCALES[names[found[0]]]
    if found:
        both = listed([names[index] for index in found])
        raise ReadingsError(f"{where}: {both} both give the time; leave one of them")
    if len(names) == 1 and (mark := next((each for each in ";\t|" if each in names[0]), None)):
        raise ReadingsError(
            f"{where}: the columns seem to be separated by {mark!r}; separate them by commas, and write decimal points"
        )
    known = listed(list(TIME_COLUMNS))
    raise ReadingsError(f"{where}: no column gives the time; the header must name one of {known}")


def places_of(where: str, names: Sequence[str], layout: Layout) -> dict[int, Place]:
    """Return which channel each column holds, by the column, without that of the time.

    Args:
        where: The header's file and line, for messages.
        names: The names of all columns.
        layout: The numbers of the measurements of the campaign's sensors.

    Raises:
        ReadingsError: A column is no channel, or two are the same one.
    """
    places: dict[int, Place] = {}
    taken: dict[tuple[str, int], str] = {}
    for index, name in enumerate(names):
        if name in _SCALES:
            continue
        place = _place(where, name, layout)
        other = taken.setdefault((place.sensor, place.channel), name)
        if other != name or names.index(name) != index:
            raise ReadingsError(
                f"{where}: the column {quoted(name)} gives what {quoted(other)} gives; leave one of them"
            )
        places[index] = place
    return places


def _place(where: str, name: str, layout: Layout) -> Place:
    """Return which channel of which sensor a column holds.

    A channel may stand without its sensor where one sensor alone has it.
    """
    sensors = [sensor for sensor in layout if name.startswith(f"{sensor}.")]
    rest, candidates = name, list(layout)
    if sensors:
        candidates = [max(sensors, key=len)]
        rest = name[len(candidates[0]) + 1 :]
    found = [
        Place(sensor, channel, factor)
        for sensor in candidates
        for channel, quantity in enumerate(layout[sensor])
        for unit, factor in factors(quantity.unit).items()
        if rest == (f"{quantity.name}_{unit}" if unit else quantity.name)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        whose = listed([f"{each.sensor}.{rest}" for each in found])
        raise ReadingsError(f"{where}: the column {quoted(name)} may be {whose}; name the sensor")
    raise ReadingsError(f"{where}: the column {quoted(name)} {_what_is_wrong(name, rest, candidates, layout)}")


def _what_is_wrong(name: str, rest: str, candidates: Sequence[str], layout: Layout) -> str:
    if not name:
        return "has no name"
    for sensor in candidates:
        for quantity in layout[sensor]:
            unit = rest.removeprefix(quantity.name)
            if unit != rest and (not unit or unit.startswith("_")):
                known = factors(quantity.unit)
                begun = [each for each in known if each and unit[1:].startswith(each)]
                meant = nearest(unit[1:], known) or max(begun, key=len, default=None)
                names = listed([f"_{each}" if each else "no unit" for each in known])
                hint = f"; did you mean {sensor}.{quantity.name}_{meant}?" if meant else ""
                said = f"has the unit {quoted(unit[1:])}" if unit else "names no unit"
                return f"{said}; {sensor}.{quantity.name} is in one of {names}{hint}"
    known_names = [column_name(sensor, quantity) for sensor, quantities in layout.items() for quantity in quantities]
    near = nearest(name, [*known_names, *TIME_COLUMNS])
    if near is not None:
        return f"is no channel of a sensor of the campaign; did you mean {near}?"
    return f"is no channel of a sensor of the campaign; those are {listed(known_names)}"
