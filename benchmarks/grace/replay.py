"""Filters on the measured K-band range of GRACE: two gravity models of a filter, tuned, replayed and scored.

Takes the files that rewrite.py writes and campaign.yaml beside this script, and does by public commands what
docs/grace.md tells: the process noise is tuned on the first three revolutions with a simulated range; readings of the
other sensors are simulated on the flown orbits and exported; the filters are replayed on these and the measured range,
and scored after the first three revolutions. Prints the tables and draws the figure of that page:

    python benchmarks/grace/replay.py FOLDER [OUT]
"""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import yaml

from relnav_sim import load_ephemeris, open_results
from relnav_sim.statistics.intervals import mean_interval

TUNED_ON = ["--set", "clock.duration_s=16950", "--set", "statistics.settle_s=5650"]
SIMULATED = ["camera", "gnss", "star_tracker"]
SHOWN = {"j2": "#D55E00", "field_20": "#0072B2"}
ROWS = ("radial", "along-track", "normal")


def relnav(folder, *words):
    """Run a command of relnav in a folder, and show it."""
    print(f"$ relnav {shlex.join(words)}", flush=True)
    subprocess.run([sys.executable, "-m", "relnav_sim", *words], cwd=folder, check=True)


def prepared(data, folder):
    """Copy the flight's files and the campaign to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("grace_a", "grace_b", "k_band"):
        shutil.copyfile(next(data.glob(f"{name}*.csv")), folder / f"{name}.csv")
    shutil.copyfile(Path(__file__).with_name("campaign.yaml"), folder / "campaign.yaml")


def measured(folder, runs):
    """Write the measured range once for each run, and return all files of readings."""
    text = (folder / "k_band.csv").read_text()
    for run in range(runs):
        (folder / f"readings/k_band_run{run}.csv").write_text(f"# run: {run}\n{text}")
    return [f"readings/{name}_run{run}.csv" for run in range(runs) for name in ("grace_readings", "k_band")]


def offset(folder):
    """Say how far the measured range is from that of the orbits."""
    a, b = (load_ephemeris(folder / f"grace_{craft}.csv").states[:, :3] for craft in "ab")
    by_link = np.loadtxt(folder / "k_band.csv", delimiter=",", skiprows=1, usecols=1)
    apart = by_link - np.linalg.norm(b - a, axis=1)
    print(
        f"measured range less that of the orbits, {len(apart)} readings: mean {apart.mean():.4f} m, "
        f"sigma {apart.std():.4f} m, at most {abs(apart - apart.mean()).max():.4f} m from the mean"
    )


def table(path, numbers):
    """Print what is scored after the first three revolutions, with 95 % intervals over the runs."""
    with open_results(path) as results:
        summary, biases = results.summary(), {name: results.augmented(0, name) for name in results.filters}
        for name in results.filters:
            rows = summary["filter"] == name
            of = {key: values[rows] for key, values in summary.items()}
            ratio = {
                sensor: (of[f"settled_nis_sum_{sensor}"].sum() / of[f"settled_dof_sum_{sensor}"].sum())
                for sensor in ("k_band", "camera")
            }
            cells = [
                name,
                f"{numbers[name]:.3g}",
                interval(of["settled_r_rms_m"]),
                *(f"{of[f'settled_{axis}_rms_m'].mean():.3g}" for axis in "xyz"),
                interval(of["settled_anees"]),
                *(f"{value:.3g}" for value in ratio.values()),
                f"{biases[name].estimate[:, -1, 0].mean():.3f}",
            ]
            print("| " + " | ".join(cells) + " |")


def interval(values):
    found = mean_interval(values)
    return f"{found.estimate:.3g} [{found.low:.3g}, {found.high:.3g}]"


def figure(path, out):
    """Draw the error of one run by each axis with 3 sigma."""
    plt.rcParams.update({"font.size": 7.5, "axes.spines.top": False, "axes.spines.right": False})
    drawn, axes = plt.subplots(3, 1, figsize=(6.3, 5.2), sharex=True, layout="constrained")
    with open_results(path) as results:
        for name, colour in SHOWN.items():
            series = results.series(0, name, 0)
            hours = series.time_s / 3600
            for axis, k in zip(axes, range(3), strict=True):
                axis.plot(hours, series.error[:, k], color=colour, lw=0.7, label=name)
                for sign in (-3, 3):
                    axis.plot(hours, sign * series.sigma[:, k], color=colour, lw=0.9, ls=":")
    for axis, name, limit in zip(axes, ROWS, (12, 0.6, 12), strict=True):
        axis.axvspan(0, 16950 / 3600, color="0.93", lw=0)
        axis.set(ylabel=f"{name} [m]", ylim=(-limit, limit))
    axes[0].legend(loc="upper right", frameon=False, ncols=2)
    axes[-1].set(xlabel="time [h]", xlim=(0, 12))
    drawn.savefig(out, dpi=200)
    print(f"wrote {out}")


def main():
    data, folder = Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "results/grace")
    prepared(data, folder)
    offset(folder)
    runs = yaml.safe_load((folder / "campaign.yaml").read_text())["runs"]
    relnav(folder, "tune", "campaign.yaml", *TUNED_ON, "--out", "tuned.yaml", "--overwrite")
    relnav(folder, "run", "tuned.yaml", "--out", "simulated.h5", "--fresh")
    chosen = [word for name in SIMULATED for word in ("--sensor", name)]
    which = [word for run in range(runs) for word in ("--run", str(run))]
    (folder / "readings").mkdir(exist_ok=True)
    relnav(folder, "export", "simulated.h5", "--part", "readings", *chosen, *which, "--out", "readings/", "--overwrite")
    files = measured(folder, runs)
    relnav(folder, "replay", "tuned.yaml", "-m", *files, "--out", "replayed", "--overwrite")
    filters = yaml.safe_load((folder / "tuned.yaml").read_text())["filters"]
    numbers = {name: entry["process_noise"]["acceleration_psd_m2_s3"] for name, entry in filters.items()}
    for words, result in (("measured", "replayed/result.h5"), ("simulated", "simulated.h5")):
        print(f"\nrange {words}; {runs} runs, scored from 16950 s on")
        print(
            "| filter | process noise | position RMS, m | radial | along-track | normal | ANEES | NIS/dof range | "
            "NIS/dof camera | range bias, m |"
        )
        print("|" + "---|" * 10)
        table(folder / result, numbers)
    figure(folder / "replayed/result.h5", folder / "grace_errors.png")


if __name__ == "__main__":
    main()
