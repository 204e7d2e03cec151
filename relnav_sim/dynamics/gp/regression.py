"""Options of the regression behind learned dynamics: how many processes, with what kernel, fitted to what."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from relnav_sim.options import Options


class RegressionOptions(Options):
    """How a Gaussian process is fitted to the training points; the defaults are those that predict best."""

    processes: Literal["shared", "one_per_output"] = Field(
        default="shared",
        description="shared: one kernel and one variance serve all outputs; one_per_output: each has a process with "
        "parameters of its own, as Wei et al. (2012), at as many times the cost as there are outputs",
    )
    length_scales: Literal["one_per_input", "common"] = Field(
        default="one_per_input",
        description="Length scales of the kernel: one_per_input, or a common one, as eq. 15 of Wei et al. (2012)",
    )
    standardised: bool = Field(
        default=True,
        description="Learn from inputs and outputs less their mean, in standard deviations; false: from metres and "
        "metres a second alike, with a process of mean zero, as eqs. 12 and 15 of Wei et al. (2012)",
    )
    fitted_points: int = Field(
        default=75,
        ge=10,
        le=5000,
        description="Training points, evenly spaced, that the kernel's parameters are fitted to; all of them where "
        "there are no more. Default 75: with error-free data more points give larger errors off the training data, "
        "because rounding then limits the likelihood, and noisy data lose nothing. Wei et al. (2012): all 500",
    )
    calibrated: bool = Field(
        default=True,
        description="Multiply the variance by what errors at points that were not learned call for; false: the "
        "process's own, as published",
    )
    noise_counted: bool = Field(
        default=True,
        description="Count the noise sigma_n^2 in the variance of the next state; false: the variance without it, as "
        "eq. 14 of Wei et al. (2012)",
    )
