"""What an epoch of a filter costs by its formula, from the campaign that a result holds."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import ValidationError

from relnav_sim.filters.operations import Operations, Size
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.results.read import Results
from relnav_sim.results.settings import filter_settings


def stated_operations(
    results: Results, index: int, name: str, augmented: int, channels: Iterable[int]
) -> Operations | None:
    """Return the operations of a filter in a case, None where its kind states none or is not installed.

    Args:
        results: An opened result.
        index: Which case.
        name: The filter.
        augmented: Number of its augmented states.
        channels: Channels of its updates; the largest counts.
    """
    settings = dict(filter_settings(results, index, name))
    prefix = f"filters.{name}."
    for path, value in results.headers[index].variables.items():
        if path.startswith(prefix):
            settings[path.removeprefix(prefix)] = value
    kind, m = filter_kinds().get(str(settings.get("kind"))), max(channels, default=0)
    if kind is None or kind.operations is None or m == 0:
        return None
    own = {key: value for key, value in settings.items() if key in kind.options_model.model_fields}
    try:
        options = kind.options_model.model_validate(own, strict=False)
    except ValidationError:  # of a version with other options
        return None
    return kind.operations(Size(6 + augmented, m), options)
