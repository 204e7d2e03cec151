"""Reports: the tables, figures and words that say which filter to fly."""

from relnav_sim.report.write import FORMATS, write_report

__all__ = ["FORMATS", "write_report"]
