"""What a result's own campaign is needed for, whatever the start: the files that it names are not needed any more."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim import load_campaign, load_ephemeris, open_results, run_campaign, simulate
from relnav_sim.cli.app import app
from relnav_sim.results.block import RefusedError
from relnav_sim.results.stored_campaign import stored_campaign

LINES = """GRACE-FO 1
1 43476U 18047A   18365.89673225 +.00000266 +00000-0 +96631-5 0  9993
2 43476 088.9970 209.2025 0019272 138.9449 221.3254 15.23792965033965
GRACE-FO 2
1 43477U 18047B   18365.89702718 +.00000263 +00000-0 +95755-5 0  9997
2 43477 088.9971 209.2044 0019074 138.5411 221.7288 15.23793300033968
"""
OMM = """CCSDS_OMM_VERS = 2.0
CREATION_DATE = 2019-01-01T00:00:00
ORIGINATOR = TEST
OBJECT_NAME = GRACE-FO 1
OBJECT_ID = 2018-047A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2018-12-31T21:31:17.6664
MEAN_MOTION = 15.23792965
ECCENTRICITY = 0.0019272
INCLINATION = 88.9970
RA_OF_ASC_NODE = 209.2025
ARG_OF_PERICENTER = 138.9449
MEAN_ANOMALY = 221.3254
BSTAR = 0.0000096631
"""
RADIUS_M, RATE_RAD_S = 6.9e6, 1.101508e-3


def table() -> str:
    """Return an orbit in the equator's plane, a row a minute for half an hour."""
    rows = ["# frame: EME2000", "# epoch: 2021-07-10T16:00:00 UTC", "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"]
    for time in range(0, 1801, 60):
        c, s = RADIUS_M * np.cos(RATE_RAD_S * time), RADIUS_M * np.sin(RATE_RAD_S * time)
        rows.append(f"{time},{c:.6f},{s:.6f},0,{-RATE_RAD_S * s:.9f},{RATE_RAD_S * c:.9f},0")
    return "\n".join(rows) + "\n"


RELATIVE = "relative: {position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}"
STARTS = {
    "elements": ("orbit: {altitude_km: 500, i_deg: 60}", RELATIVE),
    "state": ("cartesian: {position_km: [6900, 0, 0], velocity_km_s: [0, 7.6, 0]}", "roe: {a_dlambda_m: 1000}"),
    "lines": ("tle: {file: pair.tle, name: GRACE-FO 1}", RELATIVE),
    "both by lines": ("tle: {file: pair.tle, name: GRACE-FO 1}", "tle: {file: pair.tle, name: GRACE-FO 2}"),
    "message": ("omm: {file: one.omm}", RELATIVE),
    "recorded": ("ephemeris: {file: orbit.csv}", RELATIVE),
}


def campaign_text(chief: str, deputy: str, epoch: str = "") -> str:
    return (
        "name: one\nseed: 3\nruns: 1\nclock: {duration_s: 60, step_s: 10, store_every_s: 10}\n"
        f"truth:\n{epoch}  chief: {{{chief}, mass_kg: 500, area_m2: 1}}\n"
        f"  deputy: {{{deputy}, mass_kg: 500, area_m2: 1}}\n"
        "sensors: {radar: {range_sigma_m: 4, angle_sigma_deg: 0.0667}}\nstatistics: {settle_s: 20}\n"
        "filters: {ekf: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}}\n"
    )


@pytest.mark.parametrize(
    "start",
    [pytest.param(name, marks=[] if name == "both by lines" else pytest.mark.slow) for name in STARTS],
)
def test_a_result_is_simulated_again_without_the_files_of_its_start(start: str, tmp_path: Path) -> None:
    chief, deputy = STARTS[start]
    named = {"pair.tle": LINES, "one.omm": OMM, "orbit.csv": table()}
    for name, text in named.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    epoch = "  epoch: 2021-07-10T16:05:00 UTC\n" if start in ("elements", "state") else ""
    (tmp_path / "one.yaml").write_text(campaign_text(chief, deputy, epoch), encoding="utf-8")
    campaign = load_campaign(tmp_path / "one.yaml")
    flown = simulate(campaign)
    result = run_campaign(campaign, tmp_path / "one.h5", workers=1, backend="sequential")
    for name in named:
        (tmp_path / name).unlink()
    for words in (("truth", "oem"), ("estimates", "oem"), ("readings", "csv"), ("readings", "tdm")):
        found = CliRunner().invoke(app, ["export", str(result), "--part", words[0], "--to", words[1], "--overwrite"])
        assert found.exit_code == 0, found.output
    back = load_ephemeris(tmp_path / "one_truth_run0_chief.oem")
    np.testing.assert_allclose(back.states, flown.chief[0], rtol=0, atol=1e-8)
    found = CliRunner().invoke(app, ["report", str(result)])
    assert found.exit_code == 0, found.output
    assert "not looked at" not in found.output


@pytest.mark.parametrize("whole", [True, False])
def test_a_result_whose_cases_are_files_says_how_to_keep_them(whole: bool, tmp_path: Path) -> None:
    (tmp_path / "pair.tle").write_text(LINES, encoding="utf-8")
    sets = ["GRACE-FO 1", "GRACE-FO 2"]
    if whole:
        grid = f"truth.chief.tle: [{', '.join(f'{{file: pair.tle, name: {name}}}' for name in sets)}]"
    else:
        grid = f"truth.chief.tle.name: [{', '.join(sets)}]"
    (tmp_path / "one.yaml").write_text(
        campaign_text("tle: {file: pair.tle, name: GRACE-FO 1}", RELATIVE) + f"grid: {{{grid}}}\n", encoding="utf-8"
    )
    result = run_campaign(load_campaign(tmp_path / "one.yaml"), tmp_path / "one.h5", workers=1, backend="sequential")
    (tmp_path / "pair.tle").unlink()
    words = ["export", str(result), "--part", "truth", "--to", "oem", "--case", "1"]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == (0 if whole else 2), found.output
    if not whole:
        with pytest.raises(
            RefusedError, match=r"it varies truth\.chief\.tle\.name, .* vary truth\.chief\.tle as a whole"
        ):
            stored_campaign(open_results(result))
