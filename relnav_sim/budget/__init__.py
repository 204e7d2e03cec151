"""Error budgets: linear covariance analysis of a filter along the nominal truth, source by source."""

from relnav_sim.budget.budget import Budget, budgeted_filters, error_budget

__all__ = ["Budget", "budgeted_filters", "error_budget"]
