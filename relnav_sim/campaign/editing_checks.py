"""What a filter's measurement editing wants of its kind and its sensors, and can't have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.problems import Problem, listed
from relnav_sim.campaign.restarts import restart_sensors
from relnav_sim.filters.registry import filter_kinds, not_edited
from relnav_sim.sensors import Sensors, form_taken, relative_sensors


def check_editing(name: str, entry: FilterEntry, sensors: Sensors | None) -> Iterator[Problem]:
    """Yield what does not fit in a filter's `editing` or its former `gate_probability`."""
    editing = entry.editing
    if editing is None:
        return
    if not filter_kinds()[entry.kind].edits:
        yield Problem(("filters", name, "editing"), not_edited(entry.kind))
        return
    if getattr(entry, "gate_probability", None) is not None:
        yield Problem(
            ("filters", name, "gate_probability"),
            "is the former name of editing.probability; leave it out, as this filter has editing",
        )
    if entry.smoother is not None and editing.action in ("inflate", "restart"):
        yield Problem(
            ("filters", name, "smoother"),
            f"a smoother goes back by the filter's own steps, and {editing.action} is none of them; take "
            "editing.action: accept, or leave this key out",
        )
    if entry.out_of_sequence == "buffer":
        yield Problem(
            ("filters", name, "out_of_sequence"),
            "rejections are counted as measurements arrive, and a buffer goes over them again; take drop, or leave "
            "editing out",
        )
    own_belief = entry.process_noise.adaptive is not None and getattr(
        filter_kinds()[entry.kind].factory, "stochastic", False
    )
    if own_belief and editing.action in ("inflate", "restart"):
        yield Problem(
            ("filters", name, "editing", "action"),
            f"adaptive process noise and the random numbers of {entry.kind} can't be started anew; take accept, or "
            "another form of process noise",
        )
    if sensors is None or not set(entry.sensors or ()) <= set(relative_sensors(sensors)):
        return  # a sensor that is not there is said already
    used = relative_sensors(sensors, entry.sensors)
    if editing.action == "restart" and used and not restart_sensors(sensors, entry.sensors):
        yield Problem(
            ("filters", name, "editing", "action"),
            f"none of its sensors ({listed(list(used), 'and')}) gives a position at the epoch of its measurement, so "
            "there is no fix to restart from; take accept or inflate",
        )
    for each, options in used.items():
        if editing.scope == "channel" and form_taken(options, entry.measurement) != options.forms[0]:
            yield Problem(
                ("filters", name, "editing", "scope"),
                f"the filter takes {each} converted to a position, which counts as a whole; take scope: sensor, or "
                "measurement: spherical",
            )


def editing_warnings(filters: Mapping[str, FilterEntry]) -> list[str]:
    """Return a sentence on each filter that says its editing in the former way, or has no way back from a lock-out."""
    found = []
    for name, entry in filters.items():
        probability = getattr(entry, "gate_probability", None)
        if probability is not None:
            found.append(
                f"filters.{name}.gate_probability is the former name of a gate alone; write editing: {{probability: "
                f"{probability:g}}}, whose lock-outs and recoveries results count, and give it an action."
            )
        elif entry.editing is not None and entry.editing.action is None:
            found.append(
                f"filters.{name} rejects measurements and has no way back once it has lost the truth; editing.action "
                "(accept, inflate or restart) gives one."
            )
    return found
