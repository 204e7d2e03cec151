"""Filters on the measured K-band range of GRACE: two gravity models of a filter, tuned, replayed and scored.

Takes the files that rewrite.py writes and campaign.yaml beside this script, and does by public commands what
docs/grace.md tells: the process noise is tuned on the first three revolutions with a simulated range; readings of the
other sensors are simulated on the flown orbits and exported; the filters are replayed on these and the measured range,
and scored after the first three revolutions. One of them is replayed once more with the process noise that tuning finds
where truth and filter share their field. Prints the tables and draws the figure of that page:

    python benchmarks/grace/replay.py FOLDER [OUT]
"""

import csv
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from textwrap import shorten

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import yaml

from relnav_sim import load_ephemeris, open_results
from relnav_sim.statistics.intervals import mean_interval

SETTLED_S = 16950
TUNED_ON = ["--set", f"clock.duration_s={SETTLED_S}", "--set", "statistics.settle_s=5650"]
SIMULATED = ["camera", "gnss", "star_tracker"]
TRUSTING = "j2_to_j4"
SHOWN = {"j2": "#D55E00", "field_20": "#0072B2"}
ROWS = ("radial", "along-track", "normal")


def relnav(folder, *words):
    """Run a command of relnav in a folder, and show it."""
    print(f"$ {shorten(shlex.join(['relnav', *words]), 200)}", flush=True)
    subprocess.run([sys.executable, "-m", "relnav_sim", *words], cwd=folder, check=True)


def prepared(data, folder):
    """Copy the flight's files and the campaign to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("grace_a", "grace_b", "k_band"):
        shutil.copyfile(next(data.glob(f"{name}*.csv")), folder / f"{name}.csv")
    shutil.copyfile(Path(__file__).with_name("campaign.yaml"), folder / "campaign.yaml")


def with_shared_field(folder, name):
    """Write the campaign with one filter and a truth from the flown start states under J2 to J4, the filter's own."""
    campaign = yaml.safe_load((folder / "campaign.yaml").read_text())
    files = campaign["truth"]["ephemeris"]
    craft = {key: {"ephemeris": {"file": file}, "mass_kg": 450, "area_m2": 1} for key, file in files.items()}
    campaign["truth"] = {"epoch": campaign["truth"]["epoch"], **craft, "forces": {"zonals": 4, "drag": "none"}}
    campaign["filters"] = {name: campaign["filters"][name]}
    (folder / "shared_field.yaml").write_text(yaml.safe_dump(campaign, sort_keys=False))


def tuned_noise(path):
    """Return the process noise of each filter of a campaign."""
    filters = yaml.safe_load(path.read_text())["filters"]
    return {name: entry["process_noise"]["acceleration_psd_m2_s3"] for name, entry in filters.items()}


def measured(folder, runs):
    """Write the measured range once for each run, and return all files of readings."""
    text = (folder / "k_band.csv").read_text()
    for run in range(runs):
        (folder / f"readings/k_band_run{run}.csv").write_text(f"# run: {run}\n{text}")
    return [f"readings/{name}_run{run}.csv" for run in range(runs) for name in ("simulated_readings", "k_band")]


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
                f"{biases[name].estimate[:, -1, 0].mean():.3f} ± {biases[name].sigma[:, -1, 0].mean():.3f}",
            ]
            print("| " + " | ".join(cells) + " |")


def heading(words):
    """Print the head of a table."""
    print(f"\n{words}")
    sizes = ("position RMS, m", *ROWS, "ANEES", "NIS/dof range", "NIS/dof camera", "range bias, m")
    print(f"| filter | process noise, m^2/s^3 | {' | '.join(sizes)} |\n|{'---|' * 10}")


def interval(values):
    found = mean_interval(values)
    return f"{found.estimate:.3g} [{found.low:.3g}, {found.high:.3g}]"


def largest_residuals(folder):
    """Say where in run 0 the measured range was farthest from the prediction of field_20, above it and below."""
    with (folder / "replayed/residuals.csv").open(newline="") as file:
        rows = [
            (float(row["time_s"]), float(row["residual"]))
            for row in csv.DictReader(file)
            if (row["filter"], row["run"], row["sensor"]) == ("field_20", "0", "k_band")
        ]
    times_s, residuals = np.array([row for row in rows if row[0] >= SETTLED_S]).T
    orbit = load_ephemeris(folder / "grace_a.csv")
    for k in (residuals.argmax(), residuals.argmin()):
        ((x, y, z),) = orbit.at([times_s[k]])[:, :3]
        latitude, longitude = np.degrees([np.arctan2(z, np.hypot(x, y)), np.arctan2(y, x)])
        print(
            f"residual of the range under field_20: {residuals[k]:.3f} m at {times_s[k] / 3600:.2f} h, "
            f"over latitude {latitude:.0f}, longitude {longitude:.0f} deg"
        )


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
    for axis, name, limit in zip(axes, ROWS, (12, 4, 8), strict=True):
        axis.axvspan(0, SETTLED_S / 3600, color="0.93", lw=0)
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
    replay = ["replay", "tuned.yaml", "-m", *measured(folder, runs), "--overwrite"]
    relnav(folder, *replay, "--out", "replayed")
    with_shared_field(folder, TRUSTING)
    relnav(folder, "tune", "shared_field.yaml", *TUNED_ON, "--out", "shared_field_tuned.yaml", "--overwrite")
    numbers, trusting = (tuned_noise(folder / f"{name}.yaml") for name in ("tuned", "shared_field_tuned"))
    change = f"filters.{TRUSTING}.process_noise.acceleration_psd_m2_s3={trusting[TRUSTING]}"
    relnav(folder, *replay, "--filter", TRUSTING, "--set", change, "--out", "trusting")
    heading(f"range measured; {runs} runs, scored from {SETTLED_S} s on")
    table(folder / "replayed/result.h5", numbers)
    table(folder / "trusting/result.h5", trusting)
    heading("the same with a simulated range")
    table(folder / "simulated.h5", numbers)
    largest_residuals(folder)
    figure(folder / "replayed/result.h5", folder / "grace_errors.png")


if __name__ == "__main__":
    main()
