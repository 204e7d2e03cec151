"""Every filter of the registry, in a size for tests."""

from relnav_sim.filters.registry import filter_kinds

KINDS = sorted(filter_kinds())

# Those whose estimate of an epoch knows nothing of later readings.
CAUSAL = [kind for kind in KINDS if not filter_kinds()[kind].repeats]

# What it takes to run each filter in a test's time; the algorithm stays the same.
SMALLER = {"samples": 200, "particles": 200}
FEWER = {"skf": {"iterations": 5}}


def small_options(kind):
    fields = filter_kinds()[kind].options_model.model_fields
    return {name: value for name, value in SMALLER.items() if name in fields} | FEWER.get(kind, {})
