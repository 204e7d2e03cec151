"""What a result says of recorded readings: written, read back, and refused where it is damaged."""

from dataclasses import asdict

import pytest

from relnav_sim.results.campaign_header import ReplayHeader

HEADER = ReplayHeader({"pass.csv": "00ff"}, "the orbits of the campaign's truth.ephemeris", (0, 3))


def test_it_is_read_back():
    assert ReplayHeader.of_plain(asdict(HEADER)) == HEADER


@pytest.mark.parametrize(
    "change",
    [{"files": ["pass.csv"]}, {"files": {"a": 1}}, {"truth": None}, {"runs": []}, {"runs": [3, 0]}, {"runs": [0, 0]},
     {"runs": [-1]}, {"runs": [0.5]}, {"runs": "0"}, {"runs": [True]}],
)  # fmt: skip
def test_damage_is_refused(change):
    with pytest.raises(ValueError, match="no"):
        ReplayHeader.of_plain(asdict(HEADER) | change)
