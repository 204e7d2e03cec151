"""docs/first-decision.md from top to bottom: its file, its commands in order, and the output that it shows."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from site_pages import ROOT, blocks

from relnav_sim import load_campaign

PAGE = ROOT / "docs" / "first-decision.md"


def of(*languages):
    return [block for block in blocks(PAGE) if block.language in languages]


def plain(text):
    return [" ".join(line.split()) for line in text.split("\n") if line.strip()]


def test_its_campaign_is_valid(tmp_path):
    (campaign,) = of("yaml")
    (tmp_path / "first.yaml").write_text(campaign.text, encoding="utf-8")
    assert len(load_campaign(tmp_path / "first.yaml").with_stress().cases) == 3
    for block in of("sh"):
        for line in block.text.split("\n"):
            assert line.startswith("relnav ")


@pytest.mark.slow
def test_what_it_shows_is_what_comes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = []
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "120", "PYTHONPATH": str(ROOT)
    }  # fmt: skip
    for block in of("yaml", "sh", "python", "text"):
        if block.language == "yaml":
            Path("first.yaml").write_text(block.text, encoding="utf-8")
            assert yaml.safe_load(block.text)["name"] == "first"
        elif block.language == "text":
            missing = [line for line in plain(block.text) if line != "..." and line not in said]
            assert not missing, "\n".join([*missing, "in", *said])
        else:
            command = ["bash", "-ec", block.text] if block.language == "sh" else [sys.executable, "-c", block.text]
            done = subprocess.run(command, capture_output=True, text=True, env=environment)
            assert done.returncode == 0, done.stderr
            said = plain(done.stdout + done.stderr)
            if "compare" in block.text:  # which the page tells in words
                shown = " ".join(said)
                for number in ("0.35 [0.29,", "0.41]", "0.064 [0.036,", "0.093]"):
                    assert number in shown
