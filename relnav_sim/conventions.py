"""Values that several rooms must agree on, each written down once."""

CHUNK_EPOCHS = 512
"""Epochs that are simulated and filtered at a time. Fixed, so that sums over a run round alike whatever the block."""

CONFIDENCE = 0.95
"""Confidence of intervals, bands and verdicts unless the user asks for another."""

RESERVED_NAMES = frozenset({"trajectory", "time", "component", "quantity", "truth", "bound", "failures"})
"""Names inside a case's group of a results file, which no filter may take."""
