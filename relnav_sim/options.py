"""The base of every options model: what a campaign file or a keyword argument may say."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import BaseModel, ConfigDict


class Options(BaseModel):
    """Frozen, strict options: unknown keys, wrong types, NaN and infinity are refused.

    Attributes:
        former_keys: Keys that had another name once, by their name now. Campaigns may still use the former name, and
            hashes are taken over it, so that a rename changes no campaign.
        former_words: The same of the words that a key takes, by the key and the word now.
    """

    former_keys: ClassVar[Mapping[str, str]] = {}
    former_words: ClassVar[Mapping[str, Mapping[str, str]]] = {}

    # A section within another needs no validator of its own, so none is built before one is asked for.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True)


@dataclass(frozen=True)
class AddedLater:
    """Marks an option that campaigns did not have at first: at its default it stays outside their hashes."""


@dataclass(frozen=True)
class OfReports:
    """Marks an option that only reports look at: no value of it changes a result, so it stays outside hashes."""


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


@dataclass(frozen=True)
class Origin:
    """Marks an option that says where the content of another one came from: hashes are over the content alone.

    Args:
        of: The option that holds the content; while it is empty, this one stays within hashes.
    """

    of: str


Told = Literal["noise", "absence", "never", "states", "latency", "arrival"]


@dataclass(frozen=True)
class Effect:
    """Marks an option of a sensor, or of its noise, as an effect that reports show beside what filters are told of it.

    Options with the same name make one effect, which is there where the first of them is set. An option of a sensor
    without a mark is part of its white noise where its key has ``sigma`` in it.

    Args:
        name: What it is, as ``field of view``.
        told: What filters are told: ``noise``, white noise, by their `assumed_noise`; ``absence``, the measurement that
            is missing tells it; ``never``; ``states``, those filters know of it that carry it as augmented states;
            ``latency``, by their `assumed_latency`; ``arrival``, by their `out_of_sequence`.
        states: Kinds of the augmented states that carry it; default: the sensor's `error_states`.
    """

    name: str
    told: Told
    states: tuple[str, ...] = ()
