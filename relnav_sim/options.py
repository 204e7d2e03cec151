"""The base of every options model: what a campaign file or a keyword argument may say."""

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict


class Options(BaseModel):
    """Frozen, strict options: unknown keys, wrong types, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


@dataclass(frozen=True)
class Tunable:
    """Marks an option that `relnav tune` searches: ``alpha: Annotated[float, Tunable(0.01, 1)] = Field(...)``.

    Args:
        low: Least value that is tried.
        high: Greatest.
        log: Search on a logarithmic scale.
        when: (option, value): only where another option of the same model has this value.
        scales_noise: It acts as a factor on the measurement noise. The estimate then depends on its ratio to the
            process noise alone, so it is searched by default only where the objective counts the covariance too.
    """

    low: float
    high: float
    log: bool = True
    when: tuple[str, str] | None = None
    scales_noise: bool = False
