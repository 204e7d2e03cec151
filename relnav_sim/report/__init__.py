"""Reports: the tables, figures and words that say which filter to fly."""

from relnav_sim.plots.registry import FIGURE_KINDS, figure
from relnav_sim.report.write import FORMATS, write_report

__all__ = ["FIGURE_KINDS", "FORMATS", "figure", "write_report"]
