"""The page of a replay: what recorded measurements say about each filter, the verdict first."""

from relnav_sim.report.replay.figures_of_filters import FilterFigures, figures_of
from relnav_sim.report.replay.verdict import shared_findings, verdict
from relnav_sim.report.replay.write import write_replay

__all__ = ["FilterFigures", "figures_of", "shared_findings", "verdict", "write_replay"]
