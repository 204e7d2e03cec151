"""The figures of a report: one function each, all callable on an opened result, and all kinds by name.

Every function returns a ``matplotlib.figure.Figure`` in the house style; captions stand beside them, and
``FigureKind.words`` gives them. A case is given by its number, label or id, or by its facts where they have been read
already. Failed runs are left out of every figure.
"""

from relnav_sim.plots.availability import availability_over_time
from relnav_sim.plots.budget import BudgetCurves, error_budget_over_time
from relnav_sim.plots.choice import cost_against_accuracy, worst_runs
from relnav_sim.plots.conditions import error_against_range, error_around_events
from relnav_sim.plots.data import FigureError
from relnav_sim.plots.ellipses import error_ellipses
from relnav_sim.plots.errors import axis_errors, errors_with_envelope
from relnav_sim.plots.geometry import plane, trajectory
from relnav_sim.plots.grid import heat_map
from relnav_sim.plots.observability import observability_over_time
from relnav_sim.plots.over_time import consistency_over_time, covariance_against_error, rms_over_time
from relnav_sim.plots.registry import FIGURE_KINDS, FigureKind, figure
from relnav_sim.plots.regret import regret_by_case
from relnav_sim.plots.residuals import residual_whiteness
from relnav_sim.plots.scenario import scenario
from relnav_sim.plots.spread import box_plots, violin_plots
from relnav_sim.plots.sweeps import accuracy_by_case, sweep_boxes, sweep_trend

__all__ = [
    "FIGURE_KINDS",
    "BudgetCurves",
    "FigureError",
    "FigureKind",
    "accuracy_by_case",
    "availability_over_time",
    "axis_errors",
    "box_plots",
    "consistency_over_time",
    "cost_against_accuracy",
    "covariance_against_error",
    "error_against_range",
    "error_around_events",
    "error_budget_over_time",
    "error_ellipses",
    "errors_with_envelope",
    "figure",
    "heat_map",
    "observability_over_time",
    "plane",
    "regret_by_case",
    "residual_whiteness",
    "rms_over_time",
    "scenario",
    "sweep_boxes",
    "sweep_trend",
    "trajectory",
    "violin_plots",
    "worst_runs",
]
