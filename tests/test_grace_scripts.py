"""The scripts of docs/grace.md, on a flight of the same form that is simulated here; the flown data are not needed."""

import importlib.util
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from relnav_sim import ForceModel, itrf_from_eci, load_campaign, load_ephemeris, propagate
from relnav_sim.astro.epoch import Epoch

SCRIPTS = Path(__file__).parents[1] / "benchmarks" / "grace"
EPOCH = "2010-07-27T00:00:00 GPS"
ROWS = 4330  # a little more than half a day


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Two orbits and their distance in the form of the LEOGPS repository: states (2, rows, 6), ITRF, and the folder."""
    chief = np.array([6.83e6, 0.0, 0.0, 0.0, 130.0, 7640.0])
    deputy = np.array([6.826e6, 0.0, 227e3, -254.0, 130.0, 7636.0])
    times_s = 10.0 * np.arange(ROWS)
    earth = ForceModel(3.986004415e14, 6378136.3, zonals=(1.0826e-3,))
    states = itrf_from_eci(propagate(np.stack([chief, deputy]), times_s, earth), times_s, EPOCH)
    folder = tmp_path_factory.mktemp("leogps")
    dates = [datetime(2010, 7, 27) + timedelta(seconds=t) for t in times_s]
    stamps = [f"{date.day}/{date.month}/{date.year},{date:%H:%M:%S}" for date in dates]

    def write(name, values):
        rows = [",".join(f"{value:.10g}" for value in np.atleast_1d(row)) for row in values]
        (folder / name).write_text("".join(f"{date},{row}\n" for date, row in zip(stamps, rows, strict=True)))

    for name, orbit in zip(("grca_truth.csv", "grcb_truth.csv"), states, strict=True):
        write(name, orbit * np.repeat([1e-3, 10.0], 3))
    write("grc_kb_rng.csv", np.linalg.norm((states[1] - states[0])[:, :3], axis=1))
    return states, folder


def script(name):
    spec = importlib.util.spec_from_file_location(f"grace_{name}", SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_rewritten_files_are_the_flight_and_fit_the_campaign(flight, tmp_path, monkeypatch):
    states, folder = flight
    monkeypatch.setattr("sys.argv", ["rewrite.py", str(folder), str(tmp_path)])
    script("rewrite").main()
    for name, orbit in zip(("grace_a", "grace_b"), states, strict=True):
        read = load_ephemeris(tmp_path / f"{name}.csv")
        assert (read.frame, read.epoch) == ("ITRF", Epoch.parse(EPOCH))
        assert len(read.states) == 4321
        # Ten digits of kilometres and of dm/s.
        np.testing.assert_allclose(read.states[:, :3], orbit[:4321, :3], rtol=0, atol=1.1e-3)
        np.testing.assert_allclose(read.states[:, 3:], orbit[:4321, 3:], rtol=0, atol=1.1e-6)
    monkeypatch.chdir(tmp_path)
    replay = script("replay")
    replay.prepared(tmp_path, tmp_path / "out")
    campaign = load_campaign(tmp_path / "out" / "campaign.yaml")
    assert campaign.cases[0].config.clock.duration_s == 43200
