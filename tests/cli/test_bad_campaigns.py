"""Bad campaign files, each refused with exit code 2, at least one `file:line:` sentence and no traceback."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim.cli.app import app

ROOT = Path(__file__).parents[2]
DEMO = (ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8")


def edit(old, new):
    assert old in DEMO, f"the demo campaign has no {old!r}"
    return DEMO.replace(old, new, 1)


def without(key):
    """The demo without a top-level key and what belongs to it."""
    return re.sub(rf"^{key}:.*\n((?: +|\n|#).*\n)*", "", DEMO, count=1, flags=re.MULTILINE)


RADAR = "radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}"
ORBIT = "a_km: 6878, e: 0.001, i_deg: 51.6"
START = "start: {kind: first_fix, velocity_sigma_m_s: 0.5}"
DISPERSED = "start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.1}"
CAMERA = "camera: {angle_sigma_deg: 0.1}"
KF = "kind: kf # takes the radar fix converted to a position"

# name: (file, what one of the problems must say)
BAD = {
    "learned without a fix": (
        edit(RADAR, CAMERA)
        .partition("grid:")[0]
        .replace(START, DISPERSED)
        .replace("kind: cw}", "kind: gp}")
        .replace(KF, "kind: ekf"),
        "dynamics: there is no track to learn from, as no sensor here gives a position by itself",
    ),
    "empty": ("", "the file is empty"),
    "blank": ("\n\n  \n", "the file is empty"),
    "only comments": ("# nothing\n", "the file is empty"),
    "a list": ("- a\n- b\n", "must hold keys"),
    "a text": ("campaign", "must hold keys"),
    "a number": ("010", "leading zero"),
    "binary": (bytes(range(256)) * 4, "binary"),
    "an hdf5 file": (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "results file"),
    "utf-16": (DEMO.encode("utf-16"), "UTF-16"),
    "utf-32": (DEMO.encode("utf-32"), "UTF-32"),
    "latin-1": (DEMO.encode() + "# Störung\n".encode("latin-1"), "not UTF-8"),
    "50 MB": (b"# " + b"x" * 50_000_000, "250 kB"),
    "many values": ("- 1\n" * 50_000, "10000 values"),
    "3000 brackets": ("name: " + "[" * 3000, "levels deep"),
    "3000 open braces": ("{a: " * 3000, "levels deep"),
    "3000 indents": ("\n".join(" " * depth + "a:" for depth in range(480)), "levels deep"),
    "an alias bomb": ("a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n" + DEMO, "aliases"),
    "an anchor": (edit("kind: ekf", "kind: &k ekf"), "anchors"),
    "a tag": (edit("runs: 40", "runs: !!int 40"), "tags"),
    "a python tag": (edit("name: demo", "name: !!python/object/apply:os.system [id]"), "tags"),
    "two documents": (DEMO + "---\n" + DEMO, "second document"),
    "yaml 1.1": ("%YAML 1.1\n---\n" + DEMO, "YAML 1.2"),
    "a key twice": (DEMO + "seed: 1\n", "given twice"),
    "a nested key twice": (edit("step_s: 1 ", "step_s: 1\n  step_s: 2 "), "clock.step_s: this key is given twice"),
    "tabs": (edit("  duration_s", "\tduration_s"), "tab"),
    "bad indentation": (edit("  step_s", "   step_s"), "indent"),
    "an open bracket": (edit("[0, -2000, 100]", "[0, -2000, 100"), "not closed"),
    "an open quote": (edit("name: demo", 'name: "demo'), ""),
    "a missing space": (edit("runs: 40", "runs:40"), "':' is missing"),
    "a bell": (edit("name: demo", "name: de\x07mo"), "U+0007"),
    "an escape out of range": (edit("name: demo", 'name: "\\UFFFFFFFF"'), "not valid YAML"),
    "half a surrogate": (edit("name: demo", 'name: "\\ud800"'), "surrogate"),
    "a number as a key": (edit("  ekf:", "  7:"), "key 7 is not text"),
    "a list as a key": (DEMO + "? [a]\n: 1\n", "key must be plain text"),
    "octal": (edit("runs: 40", "runs: 010"), "runs: 010 has a leading zero"),
    "underscores": (edit("runs: 40", "runs: 1_000"), "runs: 1_000 has underscores"),
    "hexadecimal": (edit("seed: 20251030", "seed: 0x1F"), "write 31"),
    "base 60": (edit("duration_s: 600", "duration_s: 12:30"), "base-60"),
    "a decimal comma": (edit("step_s: 1 ", "step_s: 0,5 "), "decimal point"),
    "not a number": (edit("step_s: 1 ", "step_s: .nan "), "finite"),
    "infinity": (edit("duration_s: 600", "duration_s: .inf"), "finite"),
    "a huge number": (edit("duration_s: 600", "duration_s: 1e999"), "larger than"),
    "nan in words": (edit("step_s: 1 ", "step_s: nan "), "clock.step_s: must be a number, not the text 'nan'"),
    "no as a number": (edit("runs: 40", "runs: no"), "runs: must be a whole number, not the text 'no'"),
    "true as a number": (edit("step_s: 1 ", "step_s: true "), "clock.step_s: must be a number, not true"),
    "yes as a boolean": (
        edit("kind: ukf", "kind: ukf\n    redraw: yes"),
        "filters.ukf.redraw: must be true or false, not the text 'yes'",
    ),
    "one as a boolean": (edit("kind: ukf", "kind: ukf\n    redraw: 1"), "redraw: must be true or false, not 1"),
    "a date": (edit("seed: 20251030", "seed: 2025-10-30"), "not the text '2025-10-30'"),
    "a quoted number": (edit("runs: 40", 'runs: "40"'), "runs: must be a whole number, not the text '40'"),
    "a number with its unit": (edit("duration_s: 600", "duration_s: 600 s"), "write the number alone"),
    "a fraction of a run": (edit("runs: 40", "runs: 40.5"), "runs: must be a whole number, not 40.5"),
    "a real number of runs": (edit("runs: 40", "runs: 4e1"), "not 40.0; write 40"),
    "a whole number with a point": (edit("runs: 40", "runs: 4.0"), "runs: must be a whole number, not 4.0; write 4"),
    "a kind in capitals": (edit("kind: ukf", "kind: UKF"), "there is no kind 'UKF'; did you mean 'ukf'?"),
    "a kind with a hyphen": (edit("kind: ukf", "kind: sr-ukf"), "did you mean 'sr_ukf'?"),
    "a choice in capitals": (edit(KF, "kind: kf\n    measurement: Cartesian"), "did you mean 'cartesian'?"),
    "a semi-major axis in metres": (
        edit("a_km: 6878", "a_km: 6878137"),
        "a_km: must be at most 1000000, not 6878137; in metres? Write 6878.137",
    ),
    "an altitude as an orbit": (
        edit("a_km: 6878", "a_km: 500"),
        "for an altitude of 500 km write altitude_km: 500, or a_km: 6878.137",
    ),
    "an altitude": (
        edit("a_km: 6878", "height_km: 500"),
        "height_km: unknown key; did you mean 'altitude_km'? Write altitude_km: 500",
    ),
    "one receiver on both craft": (
        edit("  gnss: {", "  gnss: {host: both, "),
        "sensors.gnss.host: must be 'chief' or 'deputy', not the text 'both'",
    ),
    "a measurement before the first step alone": (
        edit(RADAR, RADAR[:-1] + ", period_s: 700}"),
        "sensors.radar.period_s: filters get their first measurement at 700 s; the run ends at 600 s",
    ),
    "a latency beyond the end": (
        edit(START, DISPERSED).replace(RADAR, RADAR[:-1] + ", latency_s: 601}"),
        "sensors.radar.latency_s: filters get their first measurement at 601 s; the run ends at 600 s",
    ),
    "an altitude in metres": (edit("a_km: 6878", "altitude_m: 512345.5"), "Write altitude_km: 512.3455"),
    "a key in metres": (edit("a_km: 6878", "a_m: 6878137.5"), "did you mean 'a_km'? Write a_km: 6878.1375"),
    "an element's whole name": (edit("i_deg: 51.6", "inclination: 51.6"), "did you mean 'i_deg'? Write i_deg: 51.6"),
    "an angle in radians": (edit("i_deg: 51.6", "i_rad: 0.5"), "Write i_deg: 28.6478897565"),
    "minutes": (edit("duration_s: 600", "duration_min: 10"), "Write duration_s: 600"),
    "kilometres for each axis": (
        edit("position_m: [0, -2000, 100]", "position_km: [0, -2, 0.1]"),
        "Write position_m: [0, -2000, 100]",
    ),
    "the Earth in kilometres": (
        edit("truth:\n", "truth:\n  constants: {mu_m3_s2: 398600.4418}\n"),
        "mu_m3_s2: 398600.4418 is the Earth's in kilometres; write 3.986004418e+14",
    ),
    "a filter that pandas reads as missing": (edit("  ekf:", "  NA:"), "filters.NA: pandas and R read 'NA'"),
    "another": (edit("  ekf:", "  nan:"), "filters.nan: pandas and R read 'nan'"),
    "one that the YAML has to quote": (edit("  ekf:", "  'null':"), "filters.null: pandas and R read 'null'"),
    "no runs": (edit("runs: 40", "runs: 0"), "runs: must be at least 1, not 0"),
    "a million runs and one": (edit("runs: 40", "runs: 1000001"), "runs: must be at most"),
    "a negative seed": (edit("seed: 20251030", "seed: -1"), "seed: must be at least 0, not -1"),
    "a seed of 70 bits": (edit("seed: 20251030", f"seed: {2**70}"), "seed: must be at most"),
    "no value": (edit("runs: 40", "runs:"), "runs: has no value"),
    "a path as a name": (edit("name: demo", "name: ../../demo"), "name: a name has 1 to 64 letters"),
    "an empty name": (edit("name: demo", 'name: ""'), "name: a name has"),
    "a long name": (edit("name: demo", "name: " + "x" * 65), "name: a name has"),
    "an unknown key": (DEMO + "sed: 1\n", "sed: unknown key; did you mean 'seed'?"),
    "a key in the wrong place": (DEMO + "step_s: 1\n", "step_s: unknown key; it belongs in 'clock'"),
    "a key of another kind": (
        edit("kind: ukf\n    dynamics: {kind: cw}", "kind: ukf\n    dynamics: {kind: cw, zonals: 4}"),
        "filters.ukf.dynamics.zonals: unknown key; it belongs to the kind 'nonlinear_j2'",
    ),
    "no name": (without("name"), "name: this key is missing"),
    "no seed": (without("seed"), "seed: this key is missing"),
    "no clock": (without("clock"), "clock: this section is missing"),
    "no truth": (without("truth"), "truth: this section is missing"),
    "no sensors": (without("sensors").partition("grid:")[0], "sensors: this section is missing"),
    "no filters": (without("filters"), "filters: a campaign needs at least one filter"),
    "filters as a list": (edit("filters:\n  kf:", "filters: [ekf]\nx:\n  kf:"), "filters: a campaign needs"),
    "clock as a number": (edit("clock:\n", "clock: 1\nx:\n"), "clock: must be a section with keys, not 1"),
    "an empty clock": (edit("clock:\n", "clock:\nx:\n"), "clock: has no value"),
    "a negative duration": (edit("duration_s: 600", "duration_s: -600"), "must be greater than 0, not -600"),
    "a step of zero": (edit("step_s: 1 ", "step_s: 0 "), "clock.step_s: must be greater than 0, not 0"),
    "a duration off the grid": (edit("duration_s: 600", "duration_s: 600.5"), "no whole number of steps"),
    "a storing time off the grid": (edit("store_every_s: 5", "store_every_s: 5.5"), "take 5 or 6"),
    "a storing time too long": (edit("store_every_s: 5", "store_every_s: 700"), "longer than the run"),
    "too many steps": (edit("step_s: 1 ", "step_s: 1e-6 "), "at most 10000000"),
    "a settling time too long": (
        edit("settle_s: 120", "settle_s: 600"),
        "statistics.settle_s: 600 s leaves nothing of a run of 600 s; write a smaller one",
    ),
    "a settling time of which the file says nothing": (
        without("statistics").replace("duration_s: 600", "duration_s: 120"),
        "statistics.settle_s: 500 s, the default, leaves nothing of a run of 120 s; write a smaller one under",
    ),
    "an eccentricity of one": (edit("e: 0.001", "e: 1"), "truth.chief.orbit"),
    "a negative eccentricity": (edit("e: 0.001", "e: -0.1"), "truth.chief.orbit"),
    "an orbit below the surface": (edit("a_km: 6878", "a_km: 6378"), "truth.chief.orbit"),
    "an orbit in metres": (edit("a_km: 6878", "a_m: 6878000"), "truth.chief.orbit.a_m: unknown key"),
    "a negative mass": (edit("mass_kg: 200", "mass_kg: -200"), "truth.chief.mass_kg: must be greater than 0"),
    "two coordinates": (edit("[0, -2000, 100]", "[0, -2000]"), "must be a list of 3 values, not a list of 2"),
    "four coordinates": (edit("[0, -2000, 100]", "[0, -2000, 100, 1]"), "must be a list of 3 values, not a list of 4"),
    "a text among coordinates": (edit("[0, -2000, 100]", "[0, -2 km, 100]"), "position_m[1]: must be a number"),
    "a sigma of zero": (edit("range_sigma_m: 2", "range_sigma_m: 0"), "range_sigma_m: must be greater than 0, not 0"),
    "a negative period": (edit(RADAR, RADAR[:-1] + ", period_s: -1}"), "period_s: must be greater than 0, not -1"),
    "a period off the grid": (edit(RADAR, RADAR[:-1] + ", period_s: 1.5}"), "radar.period_s: 1.5 s is no whole"),
    "a misspelt sigma": (edit("range_sigma_m: 2", "range_sigma: 2"), "did you mean 'range_sigma_m'?"),
    "a camera alone at the first fix": (
        edit(RADAR, CAMERA).partition("grid:")[0],
        "no sensor here gives a position by itself",
    ),
    "a linear filter with a camera": (
        edit(RADAR, CAMERA).replace(START, DISPERSED).partition("grid:")[0],
        "the kf filter needs a linear measurement, and camera gives none as spherical: leave camera out",
    ),
    "sunlit without a Sun": (edit(RADAR, CAMERA[:-1] + ", sunlit: true}"), "sunlit needs the Sun's direction"),
    "tangent biases of a converted position": (
        edit(RADAR, RADAR[:-1] + ", form: tangent}").replace(
            KF, "kind: kf\n    augment: [{kind: azimuth_bias, sigma_deg: 0.1}]"
        ),
        "take measurement: spherical, or form: spherical on the radar",
    ),
    "no radar": (edit(RADAR, "# no radar").partition("grid:")[0], "the filters have nothing to go by"),
    "an unknown noise": (edit("{kind: gaussian}", "{kind: gausian}"), "'gausian'; did you mean 'gaussian'?"),
    "a fraction above one": (edit("fraction: 0.1", "fraction: 1.1"), "fraction: must be at most 1"),
    "a misspelt fraction": (edit("fraction: 0.1", "fraction: randon"), "did you mean 'random'?"),
    "an unknown start": (edit("kind: first_fix", "kind: firstfix"), "did you mean 'first_fix'?"),
    "a start of no kind": (edit("kind: first_fix, ", ""), "start.kind: this key is missing"),
    "a start without its sigma": (
        edit(START, "start: {kind: dispersed, position_sigma_m: 10}"),
        "start.velocity_sigma_m_s: this key is missing",
    ),
    "a negative start sigma": (edit("velocity_sigma_m_s: 0.5}", "velocity_sigma_m_s: -1}"), "greater than 0, not -1"),
    "an unknown filter": (edit("kind: ekf", "kind: efk"), "filters.ekf.kind: there is no kind 'efk'"),
    "a sensor misspelt": (edit("  radar: {", "  radr: {"), "so give its kind; did you mean 'radar'?"),
    "a filter of no kind": (edit("    kind: ekf # takes range, azimuth and elevation\n", ""), "ekf.kind: this key"),
    "a filter that is a text": (edit("  ekf:\n", "  ekf: ekf\n  e2:\n"), "filters.ekf: must be a section with keys"),
    "a filter's name with a slash": (edit("  ekf:\n", "  ../ekf:\n"), "filters.../ekf: a name has"),
    "a filter's name of layout": (edit("  ekf:\n", "  truth:\n"), "take another name"),
    "an option of another filter": (edit("kind: ekf", "kind: ekf\n    kappa: 1"), "filters.ekf.kappa: unknown key"),
    "an option out of range": (edit("kind: ukf", "kind: ukf\n    alpha: 0"), "ukf.alpha: must be greater than 0"),
    "a learning filter with nothing learned": (
        edit("kind: ekf", "kind: mf_upf"),
        "needs learned dynamics: gp (or leave this key out)",
    ),
    "a polar kf": (edit(KF, "kind: kf\n    measurement: polar"), "needs a linear measurement"),
    "unknown dynamics": (edit("dynamics: {kind: cw}", "dynamics: {kind: cww}"), "did you mean 'cw'?"),
    "two process noises": (
        edit("{acceleration_psd_m2_s3: 1.0e-7}", "{acceleration_psd_m2_s3: 1.0e-7, diagonal: [1, 1, 1, 1, 1, 1]}"),
        "filters.kf.process_noise: give exactly one",
    ),
    "a negative process noise": (edit("_m2_s3: 1.0e-7", "_m2_s3: -1.0e-7"), "must be at least 0, not -1e-07"),
    "a grid of no list": (DEMO + "  clock.step_s: 1\n", "must be a list of at least one value"),
    "a grid over kinds with other keys": (
        DEMO.replace(START, DISPERSED) + "  sensors.radar.kind: [radar, camera]\n",
        "sensors.radar.range_sigma_m: unknown key; it belongs to the kind 'radar' (in the case",
    ),
    "a grid of an unknown path": (DEMO + "  clok.step_s: [1]\n", "did you mean 'clock'?"),
    "a zip of unequal lists": (
        DEMO + "zip: {clock.step_s: [1, 2], statistics.settle_s: [1, 2, 3]}\n",
        "zip: its lists must be equally long",
    ),
    "too many cases": (DEMO + f"  clock.step_s: {[*range(1, 7000)]}\n", "13998 cases; a campaign has at most 10000"),
}  # fmt: skip


def refused(arguments):
    began = time.process_time()
    result = CliRunner().invoke(app, arguments)
    took = time.process_time() - began
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    assert took < 2
    return result.stderr.splitlines()


def test_the_corpus_is_large_enough():
    assert len(BAD) >= 60


@pytest.mark.parametrize("name", BAD)
def test_a_bad_campaign_is_refused_in_sentences(name, tmp_path):
    content, words = BAD[name]
    file = tmp_path / "bad.yaml"
    file.write_bytes(content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content)
    lines = refused(["validate", str(file)])
    assert lines
    assert all(re.match(rf"{re.escape(str(file))}:[1-9][0-9]*: \S", line) for line in lines)
    assert any(words in line for line in lines), lines


def test_run_refuses_as_validate_does_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text(DEMO.replace("runs: 40", "runs: 0"), encoding="utf-8")
    assert refused(["run", "bad.yaml"]) == ["bad.yaml:13: runs: must be at least 1, not 0"]
    assert os.listdir() == ["bad.yaml"]


@pytest.mark.parametrize(
    "name", ["an alias bomb", *(pytest.param(name, marks=pytest.mark.slow) for name in ("50 MB", "many values"))]
)
def test_memory_stays_small(name, tmp_path):
    content, _ = BAD[name]
    file = tmp_path / "bad.yaml"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    program = (
        "import sys\n"
        "from relnav_sim.cli.app import app\n"
        "try: app(sys.argv[1:])\n"
        "except SystemExit as end: code = end.code\n"
        # getrusage would count the memory of the process that started this one.
        "peak = next(line for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "print(code, peak.split()[1])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "validate", str(file)], capture_output=True, text=True, check=True
    )
    code, kilobytes = done.stdout.split()
    assert code == "2"
    # Python, NumPy, SciPy and pydantic alone take half of it.
    assert int(kilobytes) < 200_000
