"""How a filter's measurements are edited, as campaigns and `create_filter` say it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from relnav_sim.options import Options, Tunable


class EditingOptions(Options):
    """Measurement editing: which measurements are rejected, and what happens once too many are in a row."""

    probability: Annotated[float, Tunable(0.9, 0.99999, log=False)] = Field(
        gt=0,
        lt=1,
        description="Probability that a measurement passes where the filter is right: it is rejected where its NIS "
        "exceeds the chi-square quantile of this probability (0.999, say)",
    )
    scope: Literal["sensor", "channel"] = Field(
        default="sensor",
        description="What is judged: sensor (a measurement as a whole, by its NIS; default) or channel (each number of "
        "it, by nu_i^2 / S_ii, so that one bad channel does not cost the others)",
    )
    max_rejects: Annotated[int, Tunable(2, 50)] = Field(
        default=10, ge=1, description="Rejections N in a row that are a lock-out, of a sensor or channel; default 10"
    )
    action: Literal["accept", "inflate", "restart"] | None = Field(
        default=None,
        description="What happens during a lock-out, until a measurement passes: accept (measurements are taken though "
        "they fail), inflate (each further rejection multiplies the covariance by `inflation`, the one that locks out "
        "included) or restart (the next fix that fails starts the run again); default: nothing, a gate alone",
    )
    inflation: Annotated[float | None, Tunable(2, 1000)] = Field(
        default=None, gt=1, description="Factor on the covariance, with action inflate; default 10"
    )

    @model_validator(mode="after")
    def _used(self) -> EditingOptions:
        if self.inflation is not None and self.action != "inflate":
            raise ValueError("inflation needs action: inflate; leave it out, or say so")
        return self
