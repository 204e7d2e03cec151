"""The committed summaries: one small file a campaign, in replication/full, each of which can be renewed alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from replication.extract import Extract, extracted, read_extract, write_extract
from replication.plan import PLAN, Say, planned_campaign

FOLDER = Path(__file__).parent / "full"


def renew(results: Mapping[str, Path], folder: Path = FOLDER, say: Say = lambda sentence: None) -> None:
    """Write the summaries of complete campaigns.

    Args:
        results: Results files of the full size by name of the campaign.
        folder: Where the summaries are.
        say: Told of every file that is written.

    Raises:
        ResultsError: A results file can't be read.
        OSError: A summary can't be written.
    """
    for name, path in results.items():
        target = folder / f"{name}.json"
        write_extract(extracted(path), target)
        say(f"wrote {target}")


def committed(campaigns: Path, folder: Path = FOLDER, say: Say = lambda sentence: None) -> dict[str, Extract]:
    """Return the committed summaries that are of the campaigns as they are now, in the order of the plan.

    Args:
        campaigns: Folder of the campaign files.
        folder: Where the summaries are.
        say: Told of those that are of other settings.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        ValueError: A summary is damaged.
    """
    found = {}
    for planned in PLAN:
        path = folder / f"{planned.name}.json"
        if not path.exists():
            continue
        extract = read_extract(path)
        if extract.campaign_hash == planned_campaign(planned, "full", campaigns).hash:
            found[planned.name] = extract
        else:
            say(f"{path} is not taken: it is of other settings than campaigns/{planned.name}.yaml")
    return found
