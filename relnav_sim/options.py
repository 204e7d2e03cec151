"""The base of every options model: what a campaign file or a keyword argument may say."""

from pydantic import BaseModel, ConfigDict


class Options(BaseModel):
    """Frozen, strict options: unknown keys, wrong types, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
