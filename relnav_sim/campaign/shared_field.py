"""The mark of campaigns whose truth knows no more of the gravity field than a filter: they can't judge that filter.

Shown by `validate` and `run`, and by the report in its summary.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.campaign.load import Campaign
from relnav_sim.campaign.paths import parse_path, replaced
from relnav_sim.campaign.warnings import together
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.truth import TruthOptions
from relnav_sim.wording import listed

Beliefs = Mapping[str, FieldExtent | None]
"""What each filter believes of the field, by its name; None: it does not say, or believes an approximation."""


def shared_field_warnings(campaign: Campaign) -> tuple[str, ...]:
    """Return which filters of a campaign know all of the truth's gravity field, a sentence each."""
    return together(
        [
            (
                case.label,
                shared_field(
                    case.config.truth.field_extent,
                    {name: entry.dynamics.believed_field for name, entry in case.config.filters.items()},
                ),
            )
            for case in campaign.cases
        ]
    )


def shared_field_of_results(
    content: Mapping[str, Any], cases: Iterable[tuple[str, Mapping[str, Any], Sequence[str]]]
) -> tuple[str, ...]:
    """Return the same of a campaign that was run; nothing of what another version of relnav has written.

    Args:
        content: The campaign's content, as `Campaign.content`.
        cases: Of each case label, values of the varied paths, and its filters.
    """
    if not {"truth", "filters"} <= content.keys():
        return ()
    said = []
    for label, variables, names in cases:
        varied: Any = {key: content[key] for key in ("truth", "filters")}
        for text, value in variables.items():
            if text.partition(".")[0] in varied:
                varied = replaced(varied, parse_path(text, varied), value)
        beliefs = {name: _believed(varied["filters"].get(name, {}).get("dynamics")) for name in names}
        said.append((label, shared_field(_extent(varied["truth"]), beliefs)))
    return together(said)


def shared_field(truth: FieldExtent | None, beliefs: Beliefs) -> list[str]:
    """Return the sentence on the filters of a case that believe in all of the truth's field; none where there are none.

    Args:
        truth: What the truth has; None where no force model makes it.
        beliefs: What the filters believe.
    """
    if truth is None:
        return []
    names = [name for name, believed in beliefs.items() if believed is not None and believed.covers(truth)]
    if not names:
        return []
    believe, their, them = ("believes", "its", "it") if len(names) == 1 else ("believe", "their", "them")
    return [
        f"{listed(names)} {believe} in all of the gravity field that the truth has ({truth}), so {their} ANEES and the "
        f"process noise that suits {them} here say nothing about flight, where the rest of the field moves a deputy at "
        f"10 km by {_rest(truth)} in a revolution (low orbit); truth.forces.gravity gives the truth more."
    ]


_LEFT_OUT = ((2, "some 200 m"), (5, "some 2 m"), (10, "some 1 m"), (20, "some 0.6 m"), (40, "some 0.2 m"))
"""What a field below a degree leaves out, as `_rest` has it; docs/dynamics.md has the measurement."""


def _rest(truth: FieldExtent) -> str:
    """Return how far the field that a truth lacks moves the relative position, RMS over a period at 622 km."""
    full = truth.degree if truth.degree < 2 else max(min(truth.degree, truth.order), 2)
    return next((size for degree, size in _LEFT_OUT if full < degree), "some centimetres")


def _extent(truth: Any) -> FieldExtent | None:
    try:
        return TruthOptions.model_validate_json(json.dumps(truth)).field_extent
    except ValidationError:
        return None


def _believed(dynamics: Any) -> FieldExtent | None:
    options = dynamics_kinds().get(dynamics["kind"]) if isinstance(dynamics, Mapping) and "kind" in dynamics else None
    try:
        return None if options is None else options.model_validate_json(json.dumps(dynamics)).believed_field
    except ValidationError:
        return None
