"""Which part of a campaign is computed here: as ``--shard I/N`` says it, or the variables of a SLURM job array."""

from __future__ import annotations

from collections.abc import Mapping

from relnav_sim.cli.failures import UserError

SLURM = "slurm"
_PREFIX = "SLURM_ARRAY_TASK_"
_BY_HAND = "or give the part by hand, as --shard 3/20"


def part_of(shard: str | None, environment: Mapping[str, str]) -> tuple[int, int]:
    """Return (i, n): the i-th of n parts.

    Args:
        shard: What ``--shard`` was given; None: all is one part.
        environment: The environment's variables.

    Raises:
        UserError: It is none, or the variables of the array are absent or don't fit together.

    Examples:
        >>> part_of("3/20", {})
        (3, 20)
        >>> part_of("slurm", {"SLURM_ARRAY_TASK_ID": "4", "SLURM_ARRAY_TASK_MIN": "0",
        ...                   "SLURM_ARRAY_TASK_MAX": "8", "SLURM_ARRAY_TASK_STEP": "4", "SLURM_ARRAY_TASK_COUNT": "3"})
        (2, 3)
    """
    if shard is None:
        return 1, 1
    if shard == SLURM:
        return _of_array(environment)
    number, _, parts = shard.partition("/")
    if all(word.isascii() and word.isdecimal() for word in (number, parts)) and 1 <= int(number) <= int(parts):
        return int(number), int(parts)
    raise UserError(f"--shard takes I/N with I from 1 to N, as 1/4, or {SLURM}, not {shard!r}")


def _of_array(environment: Mapping[str, str]) -> tuple[int, int]:
    """Return the place of an array's element among its elements, which stand at equal steps.

    Elements that are left out would be parts that nobody computes, so that they are refused.
    """
    if f"{_PREFIX}ID" not in environment:
        raise UserError(
            f"--shard {SLURM} is for elements of a SLURM job array, and there is no {_PREFIX}ID here; submit it with "
            f"sbatch --array=1-20, {_BY_HAND}"
        )
    task, count = _variable(environment, "ID"), _variable(environment, "COUNT")
    lowest, highest = _variable(environment, "MIN"), _variable(environment, "MAX")
    step = _variable(environment, "STEP") if f"{_PREFIX}STEP" in environment else 1
    expected = (highest - lowest) // step + 1 if step > 0 else 0
    if expected != count:
        raise UserError(
            f"--shard {SLURM}: an array from {lowest} to {highest} in steps of {step} has {max(expected, 0)} elements, "
            f"but {_PREFIX}COUNT is {count}; submit an array without gaps, as --array=1-20, {_BY_HAND}"
        )
    place, off = divmod(task - lowest, step)
    if off or not 0 <= place < count:
        raise UserError(
            f"--shard {SLURM}: {_PREFIX}ID is {task}, which is none of the elements from {lowest} to {highest} in "
            f"steps of {step}; {_BY_HAND.removeprefix('or ')}"
        )
    return place + 1, count


def _variable(environment: Mapping[str, str], name: str) -> int:
    text = environment.get(f"{_PREFIX}{name}")
    if text is None:
        raise UserError(f"--shard {SLURM}: {_PREFIX}{name} is not set, though {_PREFIX}ID is; {_BY_HAND[3:]}")
    if not (text.isascii() and text.isdecimal()):
        raise UserError(f"--shard {SLURM}: {_PREFIX}{name} is {text!r}, which is no number; {_BY_HAND[3:]}")
    return int(text)
