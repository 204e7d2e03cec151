"""The JSON schema of campaign files, for editors: completion, descriptions and errors while typing."""

from __future__ import annotations

import json

from relnav_sim.campaign.file_model import file_schema

MODELINE = "# yaml-language-server: $schema=schema.json"
"""First line of a campaign file beside a `schema.json`; editors with a YAML language server read it."""


def schema_text() -> str:
    """Return the JSON schema over every filter, sensor, noise and dynamics that is registered now."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "relnav campaign",
        **file_schema(),
    }
    return json.dumps(schema, indent=2) + "\n"
