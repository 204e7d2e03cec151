"""What the options of every registered dynamics say."""

from __future__ import annotations

from typing import ClassVar

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.dynamics.context import DynamicsContext, Need, TrainingRequest
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.options import Options


class DynamicsOptions(Options):
    """The base of the options of dynamics; a subclass has its ``kind: Literal[name]``, its options, and `build`.

    Attributes:
        needs: What `build` and the dynamics need beyond orbit, step and process noise; see `Need`.
        step_cost_us: Rough CPU time that a filter's step takes longer than with `cw`, for each run, us; as the others,
            for the plan of a campaign.
        step_overhead_us: The same of a step however few the runs, us.
        shared_overhead_us: The same of what filters of a block with the same options share, us.
        shared_epoch_bytes: Memory that this takes for one run and epoch, bytes.
    """

    needs: ClassVar[frozenset[Need]] = frozenset()
    step_cost_us: ClassVar[float] = 0.0
    step_overhead_us: ClassVar[float] = 0.0
    shared_overhead_us: ClassVar[float] = 0.0
    shared_epoch_bytes: ClassVar[float] = 0.0

    kind: str

    @property
    def cost_factor(self) -> float:
        """How many times its registered cost a filter takes with these dynamics, for the plan of a campaign."""
        return 1.0

    def build(self, context: DynamicsContext) -> Dynamics:
        """Return the dynamics of six states for steps of ``context.step_s`` seconds."""
        raise NotImplementedError(f"{type(self).__name__} has no build(context)")

    @property
    def uses_process_noise(self) -> bool:
        """Whether the filter's `process_noise` makes a difference to these dynamics."""
        return True

    @property
    def believed_field(self) -> FieldExtent | None:
        """How much of the Earth's gravity field the dynamics take exactly.

        None: an approximation, or not said. A campaign whose truth has no more than that is marked: it can't tell how
        the filter would do in flight.
        """
        return None

    @property
    def simpler(self) -> DynamicsOptions:
        """Dynamics that tell as well which states can be observed, for a look before a run; default: these."""
        return self

    def training_request(self, orbit: ChiefOrbit) -> TrainingRequest:
        """Return the track to learn from, for a chief's nominal orbit; with the need ``training_track``."""
        raise NotImplementedError(f"{type(self).__name__} needs a training_track and has no training_request(orbit)")
