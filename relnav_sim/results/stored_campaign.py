"""The campaign that a result is of, to be simulated again."""

from __future__ import annotations

import re
from dataclasses import replace
from weakref import WeakKeyDictionary

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.load import parse_content
from relnav_sim.campaign.problems import CampaignError
from relnav_sim.results.block import RefusedError
from relnav_sim.results.read import Results

_NAMES_A_FILE = re.compile(r"truth\.(.+\.(file|name)|forces\.gravity\.model|ephemeris\.(chief|deputy))")
_read: WeakKeyDictionary[Results, Campaign] = WeakKeyDictionary()


def stored_campaign(results: Results) -> Campaign:
    """Return the campaign of a result as it was run, what the command line set included.

    Of an opened result it is parsed once.

    Raises:
        RefusedError: This version of relnav, or a package of the user's that is not here, reads it otherwise.
    """
    if results not in _read:
        _read[results] = _parsed(results)
    return _read[results]


def _parsed(results: Results) -> Campaign:
    try:
        campaign = parse_content(results.campaign_content)
    except CampaignError as error:
        problem = error.problems[0].removeprefix("campaign:1: ")
        said = _varied_file(results) or problem
        raise RefusedError(f"{results.path}: its campaign can't be run again: {said}") from None
    if any(header.stress for header in results.headers):
        campaign = campaign.with_stress()
    if results.header.only is not None:
        held = {header.id for header in results.headers}
        campaign = replace(campaign, cases=tuple(case for case in campaign.cases if case.id in held))
    if [case.id for case in campaign.cases] != [header.id for header in results.headers]:
        if said := _varied_file(results):
            raise RefusedError(f"{results.path}: its campaign can't be run again: {said}")
        raise RefusedError(
            f"{results.path}: this relnav reads its campaign otherwise than the one that made it, so that the numbers "
            "would be others; run the campaign again"
        )
    return campaign


def _varied_file(results: Results) -> str:
    """Return why a campaign that varies the name of a file is not whole in its results; empty: it varies none."""
    content = results.campaign_content
    stressed = (path for overrides in content.get("stress", {}).values() for path in overrides)
    for path in (*(path for section in ("grid", "zip") for path in content.get(section, {})), *stressed):
        if _NAMES_A_FILE.fullmatch(path):
            whole = path.rpartition(".")[0]
            return f"it varies {path}, and what stood in the files of all cases is not kept; vary {whole} as a whole"
    return ""
