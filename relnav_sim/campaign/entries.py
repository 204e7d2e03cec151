"""A filter of a campaign: the keys that all kinds share and the kind's own options, in one model per kind."""

from __future__ import annotations

import functools
import json
import operator
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal, cast

from pydantic import ConfigDict, Field, SerializeAsAny, TypeAdapter, create_model, field_validator

from relnav_sim.dynamics.augmentation.kinds import AugmentedStateOption, AugmentedStateOptions
from relnav_sim.dynamics.augmentation.unmodelled_acceleration import process_noise_states
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.afterwards_options import BatchStartOptions, SmootherOption
from relnav_sim.filters.editing_options import EditingOptions
from relnav_sim.filters.registry import FilterKind, filter_kinds
from relnav_sim.options import AddedLater, Options
from relnav_sim.sensors.interface import AssumedNoise, Form, SensorOptions
from relnav_sim.sensors.registry import sensor_kinds

KnownThrust = Literal["none", "planned", "measured"]
AssumedLatency = Literal["known", "none"]
Kinds = tuple[tuple[str, type[DynamicsOptions]], ...]
Registered = tuple[tuple[FilterKind, ...], Kinds, tuple[tuple[str, type[SensorOptions]], ...]]

_MEASUREMENT = (
    "Form of the measurements that the filter takes: spherical (as they are read; formerly polar) or cartesian "
    "(converted to a position in the orbit frame, of sensors that allow it)"
)


class FilterEntry(Options):
    """What every filter of a campaign says; the model of each kind adds that kind's options.

    An entry is also an instance of its kind's options model, so a filter's factory takes it as it is.
    """

    former_words: ClassVar[Mapping[str, Mapping[str, str]]] = {"measurement": {"spherical": "polar"}}

    kind: str = Field(description="The filter; `relnav list filters` shows the kinds")
    dynamics: SerializeAsAny[DynamicsOptions] = Field(description="The relative motion that the filter believes in")
    process_noise: ProcessNoiseOptions = Field(
        default=ProcessNoiseOptions(acceleration_psd_m2_s3=1e-6),
        description="What the filter adds to its covariance each step; default: white acceleration of 1e-6 m^2/s^3, "
        "about the acceleration by curvature and differential J2 that cw lacks at 12 km",
    )
    sensors: Annotated[tuple[str, ...] | None, AddedLater()] = Field(
        default=None,
        min_length=1,
        description="Names of the sensors that the filter goes by, in the order in which it takes their measurements; "
        "default: all that measure the other craft",
    )
    measurement: Form = Field(description=_MEASUREMENT)
    assumed_noise: AssumedNoise = Field(
        default="total",
        description="Measurement noise that the filter believes in: nominal (the sensors' sigmas, without outliers), "
        "total (one Gaussian with the covariance of all white noise; default) or mixture (its components too, for "
        "filters that use them). No filter is told of biases, correlated parts or outages",
    )
    known_thrust: KnownThrust | None = Field(
        default=None,
        description="What the filter is told of manoeuvres: none, planned (the plan; its process noise grows by the "
        "execution errors' share) or measured (what the accelerometers read, and the plan for a craft without one); "
        "default: measured where there are accelerometers, else planned",
    )
    assumed_latency: AssumedLatency = Field(
        default="known",
        description="The sensors' latency as the filter takes it: known (it compares a measurement with the position "
        "that long ago; default) or none (it takes the measurement as fresh)",
    )

    augment: tuple[Annotated[AugmentedStateOption, Field(discriminator="kind")], ...] = Field(
        default=(),
        description="Augmented states that the filter carries behind position and velocity: biases of sensors, errors "
        "of the attitude, drag, bias of the accelerometer, clocks; each estimated or only accounted for. Default: none",
    )

    batch_start: Annotated[BatchStartOptions | None, AddedLater()] = Field(
        default=None,
        description="Begin with a batch least squares fit of the first measurements, to which the campaign's start is "
        "the prior; the filter gets the measurements after. Default: begin at the campaign's start",
    )
    smoother: Annotated[SmootherOption | None, AddedLater()] = Field(
        default=None,
        description="Improve the filter's estimates afterwards: rts (Rauch, Tung and Striebel: by all later "
        "measurements) or fixed_lag (by those of the next `lag_s`). The row then tells what is known afterwards, not "
        "in flight; its NIS is that of the filter. Default: none",
    )

    out_of_sequence: Annotated[Literal["drop", "buffer"] | None, AddedLater()] = Field(
        default=None,
        description="Measurements that arrive after their own epoch, where a sensor has a `drawn_latency_s`: drop "
        "(without them) or buffer (go back to their epoch and over all since again). Default: drop; rows that are "
        "known afterwards have all measurements in order",
    )
    editing: Annotated[EditingOptions | None, AddedLater()] = Field(
        default=None,
        description="Which measurements are rejected and how the filter recovers once it has rejected too many; "
        "default: every measurement is taken",
    )

    @field_validator("sensors")
    @classmethod
    def _named_once(cls, sensors: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if twice := sorted({name for name in sensors or () if (sensors or ()).count(name) > 1}):
            raise ValueError(f"{twice[0]} stands there twice")
        return sensors

    @field_validator("augment")
    @classmethod
    def _each_once(cls, augment: tuple[AugmentedStateOption, ...]) -> tuple[AugmentedStateOption, ...]:
        kinds = [(option.kind, option.sensor) for option in augment]
        if twice := sorted({kind for kind, sensor in kinds if kinds.count((kind, sensor)) > 1}):
            raise ValueError(
                f"{twice[0]} stands there twice; a filter carries each kind of augmented state once for each sensor"
            )
        return augment

    @property
    def augmented_states(self) -> tuple[AugmentedStateOptions, ...]:
        """All that it carries behind position and velocity: those of `augment`, and those of its process noise."""
        return (*self.augment, *process_noise_states(self.process_noise))

    def __reduce__(self) -> tuple[Callable[[dict[str, Any]], FilterEntry], tuple[dict[str, Any]]]:
        """Pickle as plain data: the models of the kinds are made at run time and have no importable name."""
        return entry_from, (self.model_dump(mode="json"),)


def entry_from(data: dict[str, Any]) -> FilterEntry:
    """Return a filter's entry from plain data, as `FilterEntry.model_dump(mode="json")` gives it."""
    return entry_adapter(str(data.get("kind"))).validate_json(json.dumps(data), strict=True)


def registered() -> Registered:
    """Return every filter, dynamics and sensor that is registered now; models made from them are kept by it."""
    return tuple(filter_kinds().values()), tuple(dynamics_kinds().items()), tuple(sensor_kinds().items())


def entry_adapter(kind: str) -> TypeAdapter[FilterEntry]:
    """Return the validator of a filter entry of a kind; over every kind registered now where there is no such kind."""
    return _entry_adapter(registered(), kind if kind in filter_kinds() else None)


def entry_type() -> Any:
    """Return the discriminated union of every registered kind's entry."""
    return _entry_type(registered())


@functools.cache
def _entry_adapter(known: Registered, kind: str | None) -> TypeAdapter[FilterEntry]:
    # The models of all kinds take a third of a second to make, and serve to say what is wrong.
    return TypeAdapter(_entry_type(known) if kind is None else _entry_model(known, kind))


@functools.cache
def _entry_type(known: Registered) -> Any:
    return one_of([_entry_model(known, kind.name) for kind in known[0]])


@functools.cache
def _entry_model(known: Registered, name: str) -> type[FilterEntry]:
    kinds, dynamics, _ = known
    kind = next(kind for kind in kinds if kind.name == name)
    motion: Any = one_of([model for _, model in dynamics])
    shared = FilterEntry.model_fields
    clash = sorted(shared.keys() & kind.options_model.model_fields.keys())
    if clash:
        raise TypeError(f"filter {kind.name!r}: its options {clash} have the names of keys that all filters share")
    usual = "gp" if kind.learned_dynamics else "cw"
    fields: dict[str, Any] = {
        "kind": (Literal[kind.name], Field(description=shared["kind"].description)),
        "dynamics": (
            motion,
            Field(
                default={"kind": usual},
                validate_default=True,
                description=f"{shared['dynamics'].description}; default {usual}",
            ),
        ),
        "measurement": (
            Form,
            Field(default=kind.measurement, description=f"{_MEASUREMENT}; default {kind.measurement}"),
        ),
    }
    made = create_model(
        f"{kind.name}_filter",
        __base__=(kind.options_model, FilterEntry),
        __doc__=kind.description.partition("\n\n")[0],
        __module__=__name__,
        **fields,
    )
    return cast(type[FilterEntry], made)


def one_of(models: list[type[Any]]) -> Any:
    """Return the union of options models that their `kind` tells apart."""
    union = functools.reduce(operator.or_, models)
    return union if len(models) == 1 else Annotated[union, Field(discriminator="kind")]


def sensor_adapter() -> TypeAdapter[SensorOptions]:
    """Return the validator of one sensor over every kind registered now."""
    return _sensor_adapter(registered())


@functools.cache
def _sensor_adapter(known: Registered) -> TypeAdapter[SensorOptions]:
    return TypeAdapter(one_of([model for _, model in known[2]]))


def sensors_type() -> Any:
    """Return the model of the whole `sensors:` section, for the schema: any name with a kind, kinds as names."""
    return _sensors_type(registered())


@functools.cache
def _sensors_type(known: Registered) -> Any:
    union = one_of([model for _, model in known[2]])

    class Sensors(Options):
        """What is measured: sensors by names of your choice, each of a `kind`; default kind: the name."""

        model_config = ConfigDict(extra="allow")
        __pydantic_extra__: dict[str, union] = Field(init=False)  # type: ignore[valid-type]  # made at run time

    fields: dict[str, Any] = {
        name: (model | None, Field(default=None, description=(model.__doc__ or "").partition("\n")[0]))
        for name, model in known[2]
    }
    return create_model("Sensors", __base__=Sensors, __doc__=Sensors.__doc__, __module__=__name__, **fields)
