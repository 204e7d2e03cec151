"""A result in Python, cell by cell.

    python docs/example-analysis.py [RESULT] [PICTURE]

Cells begin with `# %%`, which VS Code, Spyder and Jupyter (with jupytext) run one by one.
Needs the extra [xarray]; any result of `relnav run` will do.
"""

# %% What is in the file
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from relnav_sim import open_results
from relnav_sim.statistics.intervals import mean_interval, paired_difference

path = sys.argv[1] if len(sys.argv) > 1 else "results/demo.h5"
picture = sys.argv[2] if len(sys.argv) > 2 else "analysis.png"
results = open_results(path)
print(f"{results.campaign_name}: cases {results.cases}, filters {results.filters}, {len(results.runs)} runs")

# %% Labelled arrays: a tree of xarray datasets, read where they are looked at
tree = results.to_xarray()
name = results.filters[0]
one = tree[f"case_000/{name}"].ds
print(one["rms"].sel(span="settled", quantity="r").attrs["long_name"])
print(one["error"].dims, one["error"].attrs["units"])

# %% RMS of the position error of every filter: mean over the runs that did not fail, with its 95 % interval
for filter in results.filters:
    ds = tree[f"case_000/{filter}"].ds
    rms = ds["rms"].sel(span="settled", quantity="r").where(ds["failed"] == 0).dropna("run")
    found = mean_interval(rms.values)
    print(f"{filter}: {found.estimate:.3f} m [{found.low:.3f}, {found.high:.3f}] over {found.runs} runs")

# %% Two filters on the same random numbers: xarray matches their runs by number
other = results.filters[-1]
rms = {}
for key in (name, other):
    ds = tree[f"case_000/{key}"].ds
    rms[key] = ds["rms"].sel(span="settled", quantity="r").where(ds["failed"] == 0)
difference = (rms[name] - rms[other]).dropna("run")
found = paired_difference(difference.values, np.zeros(difference.size))
print(f"{name} is {found.verdict} against {other}: p = {found.p_value:.3g}, runs to decide: {found.runs_to_decide}")

# %% What the filters report of their own working
for filter in results.filters:
    for key, values in results.diagnostics(0, filter).items():
        print(f"{filter}: {key} {np.nanmean(values):.3g}")

# %% As one flat table, for pandas or a spreadsheet (relnav export RESULT --to csv writes the same)
table = results.summary()
rows = (table["filter"] == name) & ~table["failed"]
print(f"{rows.sum()} rows of {len(table)} columns; worst run: {table['run'][rows][np.argmax(table['r_rms_m'][rows])]}")

# %% A figure of one's own: the along-track error of one run between the filter's 3 sigma
run = int(one["run"][0])
error = one["error"].sel(run=run, component="y")
sigma = one["sigma"].sel(run=run, component="y")
figure, axes = plt.subplots(figsize=(3.5, 2.2), layout="constrained")
axes.plot(error["time"], error, label="error")
axes.plot(error["time"], 3 * sigma, "--", color="grey", label="3 sigma")
axes.plot(error["time"], -3 * sigma, "--", color="grey")
axes.set(xlabel="time, s", ylabel="along-track error, m", title=f"{name}, run {run}")
axes.legend()
figure.savefig(picture, dpi=150)
print(f"wrote {picture}")
results.close()
