"""Instants as campaigns write them."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator

from relnav_sim.astro.epoch import Epoch


def _known(text: str) -> str:
    Epoch.parse(text)
    return text


EpochText = Annotated[str, AfterValidator(_known)]
"""A calendar time with its time scale, as `Epoch.parse` reads it."""
