"""`arithmetic:` of a filter: no part of a campaign's identity at its default, and refused where a filter has none."""

from pathlib import Path

import pytest

from relnav_sim.campaign import CampaignError, load_campaign, parse_campaign
from relnav_sim.campaign.identity import filter_id

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
TEXT = (CAMPAIGNS / "demo.yaml").read_text(encoding="utf-8")


def of_ekf(*overrides):
    campaign = parse_campaign(TEXT, overrides)
    return campaign.hash, filter_id(campaign.cases[0].config.filters["ekf"])


def test_the_default_written_out_changes_no_hash():
    assert of_ekf("filters.ekf.arithmetic=float64") == of_ekf()
    single = of_ekf("filters.ekf.arithmetic=float32")
    assert all(own != other for own, other in zip(single, of_ekf(), strict=True))


@pytest.mark.parametrize(
    "override, sentence",
    [
        ("filters.imm.arithmetic=float32", "the imm filter computes in float64 only, as it mixes several Gaussians"),
        (
            "filters.imm.arithmetic=float32",
            "float32: kf, ekf, ukf, alpha_kf, adaptive_alpha_kf, mkf, skf, iekf, ckf, sr_ukf, ud_ekf, srif, two_step",
        ),
        ("filters.ekf.arithmetic=float16", "must be 'float64' or 'float32'"),
        ("filters.ekf.arithmetic=32", "must be"),
        ("filters.ekf.arithmetic=[float32]", "must be"),
        ("filters.ekf.arithmetics=float32", "did you mean 'arithmetic'?"),
    ],
)
def test_what_is_wrong_is_told_in_a_sentence(override, sentence):
    with pytest.raises(CampaignError) as refused:
        parse_campaign(TEXT, (override,))
    assert sentence in str(refused.value)


def test_considered_states_and_srif_do_not_go_together():
    considered = "filters.srif={kind: srif, augment: [{kind: range_bias, sigma_m: 1, mode: consider}]}"
    with pytest.raises(CampaignError, match="the srif filter can't account for a state without estimating it"):
        parse_campaign(TEXT, (considered,))


def test_the_example_of_the_page_is_valid():
    campaign = load_campaign(CAMPAIGNS / "flight_arithmetic.yaml")
    told = {name: entry.model_dump()["arithmetic"] for name, entry in campaign.cases[0].config.filters.items()}
    assert told == {name: "float32" if name.endswith("_32") else "float64" for name in told}
