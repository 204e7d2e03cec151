"""A process noise that is written in another form is told how to write it here."""

from importlib.resources import files

import pytest

from relnav_sim.campaign import parse_campaign
from relnav_sim.campaign.problems import CampaignError

DEMO = files("relnav_sim.campaign").joinpath("templates", "demo.yaml").read_text(encoding="utf-8")
START = "{radial_psd_m2_s3: 1.0e-9, along_track_psd_m2_s3: 1.0e-9, normal_psd_m2_s3: 1.0e-9}"


@pytest.mark.parametrize(
    ("kind", "noise", "said"),
    [
        ("ekf", "{kind: adaptive}", "process_noise.kind: unknown key; write adaptive: ... in its place"),
        ("ekf", "{kind: loud}", "process_noise.kind: unknown key; known here: acceleration_psd_m2_s3, "),
        ("ekf", "adaptive", "must be a section with keys, not the text 'adaptive'; write {adaptive: ...}"),
        (
            "two_step",
            f"{{adaptive: {{start: {START}}}}}",
            "take acceleration_psd_m2_s3 or snc_rtn, or a filter such as",
        ),
    ],
)
def test_the_hint_names_a_form_that_is_taken(kind: str, noise: str, said: str) -> None:
    entry = f"filters:\n  hinted: {{kind: {kind}, process_noise: {noise}}}\n"
    with pytest.raises(CampaignError) as caught:
        parse_campaign(DEMO.replace("filters:\n", entry))
    assert said in "\n".join(caught.value.problems)
