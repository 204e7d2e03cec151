import contextlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim.campaign import load_campaign
from relnav_sim.campaign.schema import schema_text
from relnav_sim.cli.app import COMMANDS, app
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.results import open_results
from relnav_sim.sensors import sensor_kinds
from relnav_sim.sensors.noise import noise_kinds

ROOT = Path(__file__).parents[2]
TINY = [
    *["--set", "clock.duration_s=20", "--set", "clock.store_every_s=5", "--set", "statistics.settle_s=10"],
    *["--runs", "4", "--backend", "sequential"],
]


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def succeeds(*arguments):
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def fails(code, *arguments):
    result = invoke(*arguments)
    assert result.exit_code == code, result.output
    assert isinstance(result.exception, SystemExit)
    return result.stderr


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def demo(here):
    (here / "demo.yaml").write_text((ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    return Path("demo.yaml")


def test_help_names_every_command():
    words = succeeds("--help")
    assert all(f" {name} " in words for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name):
    words = succeeds(name, "--help")
    assert "Usage" in words and "<bool>" not in words


@pytest.mark.parametrize("module", ["relnav_sim.kernels", "relnav_sim.campaign.reference"])
def test_every_module_that_is_a_program_has_help(module):
    done = subprocess.run([sys.executable, "-m", module, "--help"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"usage: python -m {module}")


def test_flags_have_no_type_in_help():
    assert "<bool>" not in succeeds("--help")
    assert "PATH=VALUE" in succeeds("run", "-h")


def test_a_shell_completes_commands():
    words = {"_RELNAV_COMPLETE": "complete_bash", "COMP_WORDS": "relnav re", "COMP_CWORD": "1"}
    found = CliRunner().invoke(app, [], prog_name="relnav", env=words).stdout.split()
    assert found == ["report", "replay"]


def test_help_imports_nothing_heavy():
    program = (
        "import sys\n"
        "from relnav_sim.cli.app import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pydantic', 'h5py', 'matplotlib', 'sklearn', 'joblib', 'yaml', 'numba'}\n"
        "heavy |= {'dask', 'distributed'}\n"
        "print('loaded', sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded []"


def test_what_needs_no_kernel_does_not_import_their_compiler_nor_scipy(here):
    program = (
        "import sys\n"
        "from relnav_sim.cli.app import app\n"
        "for words in ['list', 'filters'], ['show', 'filter', 'ekf'], ['schema'], ['new', 'a.yaml']:\n"
        "    try: app(words)\n"
        "    except SystemExit as end: assert not end.code\n"
        "print('loaded', sorted({'numba', 'llvmlite', 'distributed', 'scipy'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded []"


def test_version():
    from relnav_sim import __version__

    assert succeeds("--version") == f"relnav {__version__}\n"


def test_an_unknown_command_or_option_is_a_bad_argument():
    assert invoke("rnu").exit_code == 2
    assert invoke("run", "x.yaml", "--worker", "2").exit_code == 2
    assert invoke("run", "x.yaml", "--workers", "0").exit_code == 2


class TestValidate:
    def test_prints_the_plan(self, demo):
        words = succeeds("validate", demo)
        assert words.startswith("demo.yaml is a valid campaign\n")
        for part in ("sensors.radar.noise.kind=mixture", "kf, ekf, ukf", "40 of each case", "CPU time", "MB"):
            assert part in words

    def test_takes_changes(self, demo):
        assert "7 of each case" in succeeds("validate", demo, "--set", "runs=7")
        assert fails(2, "validate", demo, "--set", "runs=0") == "--set runs=0: runs: must be at least 1, not 0\n"

    def test_a_missing_file_is_an_input_error(self, here):
        assert fails(3, "validate", "missing.yaml") == "relnav: missing.yaml: No such file or directory\n"
        assert fails(3, "validate", ".").startswith("relnav: .: ")


class TestNew:
    def test_writes_a_valid_campaign_and_a_schema(self, here):
        succeeds("new", "my first.yaml")
        assert load_campaign("my first.yaml").name == "my_first"
        assert Path("schema.json").read_text(encoding="utf-8") == schema_text()

    def test_never_overwrites(self, here):
        Path("mine.yaml").write_text("precious")
        Path("schema.json").write_text("own")
        assert "nothing was written" in fails(2, "new", "mine.yaml")
        assert Path("mine.yaml").read_text() == "precious"
        succeeds("new", "other.yaml")
        assert Path("schema.json").read_text() == "own"

    def test_an_unwritable_place_is_an_output_error(self, here):
        assert "No such file" in fails(3, "new", "no/such/folder.yaml")


class TestNames:
    @pytest.mark.parametrize(
        ("what", "kinds"),
        [
            ("filters", filter_kinds()),
            ("sensors", sensor_kinds()),
            ("dynamics", dynamics_kinds()),
            ("noise", noise_kinds()),
        ],
    )
    def test_everything_registered_is_listed_and_shown(self, what, kinds):
        listed = succeeds("list", what)
        for name in kinds:
            line = next(line for line in listed.splitlines() if line.split()[:1] == [name])
            assert len(line.split()) > 3, f"{name} has no description"
            assert f"{name}: " in succeeds("show", what.removesuffix("s") if what != "dynamics" else what, name)

    def test_a_filter_is_shown_with_source_and_options(self):
        words = succeeds("show", "filter", "ukf")
        assert "Julier" in words
        for key in ("kind", "dynamics", "process_noise", "alpha", "redraw"):
            assert any(line.startswith(f"{key} ") for line in words.splitlines())

    def test_an_unknown_name_is_a_bad_argument(self):
        assert "did you mean 'ukf'?" in fails(2, "show", "filter", "ufk")
        assert invoke("show", "wheel", "ukf").exit_code == 2
        assert invoke("list", "wheels").exit_code == 2

    def test_campaigns_of_the_folder_are_listed(self, demo):
        assert "A small campaign to start with" in succeeds("list", "campaigns")


def test_schema(here):
    assert json.loads(succeeds("schema")) == json.loads(schema_text())
    succeeds("schema", "--out", "s.json")
    assert Path("s.json").read_text(encoding="utf-8") == schema_text()


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("computed")
    with contextlib.chdir(folder):
        words = succeeds("run", ROOT / "campaigns" / "demo.yaml", *TINY)
    assert words.startswith("wrote results/demo.h5; next: relnav report results/demo.h5")
    return folder / "results"


class TestResults:
    @pytest.fixture
    def result(self, here, computed):
        shutil.copytree(computed, "results")
        return Path("results/demo.h5")

    @pytest.mark.usefixtures("undrawn", "unrendered")
    def test_run_report_inspect_export(self, result):
        written, decision = succeeds("report", "--format", "html,csv").strip().splitlines()
        page = Path(written.removeprefix("wrote "))
        assert decision.startswith("No decision yet: 4 runs in common can't decide between 4 filters")
        assert page.parent == Path("results/demo")
        assert "<html" in page.read_text(encoding="utf-8")
        words = succeeds("inspect", result)
        for part in ("demo", "4 of 4", "sensors.radar.noise.kind=mixture", "kf, ekf, ukf, imm", "relnav"):
            assert part in words
        succeeds("export", result)
        rows = Path("results/demo_summary.csv").read_text(encoding="utf-8").splitlines()
        assert len(rows) == 1 + 2 * 4 * 4
        succeeds("export", result, "--part", "series", "--out", "series.csv")
        assert len(Path("series.csv").read_text(encoding="utf-8").splitlines()) == 1 + 2 * 4 * 4 * 5

    def test_missing_runs_of_parts_are_listed(self, result):
        assert succeeds("merge", "--missing", "all.h5", result) == "no run is missing\n"
        for shard in Path("results/demo.h5.shards").glob("*_*.h5"):
            shard.unlink()
        listed = invoke("merge", "all.h5", "results/demo.h5.shards", "--missing")
        assert listed.exit_code == 6
        assert [line.split()[-2:] for line in listed.stdout.splitlines()[1:]] == [["runs", "0-3"]] * 8
        refused = fails(2, "merge", "all.h5", "results/demo.h5.shards")
        assert refused.startswith(
            "relnav: 32 runs are missing: case sensors.radar.noise.kind=gaussian, filter kf: runs"
        )
        assert "and 4 more filters and cases. The same command with --missing lists them all." in refused
        assert not Path("all.h5").exists()

    def test_a_result_of_another_campaign_is_left_alone(self, demo, result):
        before = result.read_bytes()
        words = fails(2, "run", demo, *TINY, "--set", "seed=2")
        assert "results/demo.h5 holds results of other" in words
        assert "--fresh" in words
        assert result.read_bytes() == before

    def test_the_result_itself_is_never_exported_over(self, result):
        before = result.read_bytes()
        fails(2, "export", result, "--out", result)
        assert result.read_bytes() == before

    def test_some_filters_first_and_the_others_later(self, demo, computed):
        no_bound = ["--set", "bound=false"]
        few = succeeds("run", demo, *TINY, *no_bound, "--filter", "ekf", "--filter", "imm", "--out", "few.h5")
        assert few.startswith("wrote few.h5")
        assert "filters   ekf, imm\n" in succeeds("inspect", "few.h5")
        succeeds("run", demo, *TINY, *no_bound, "--out", "few.h5")
        for case in range(2):
            with open_results("few.h5") as later, open_results(computed / "demo.h5") as at_once:
                for name in ("kf", "ekf", "ukf", "imm"):
                    pair = [each.error(case, name) for each in (later, at_once)]
                    np.testing.assert_array_equal(*pair)

    def test_filters_that_are_not_there(self, demo):
        assert "--filter: no filter is named 'efk'; did you mean 'ekf'?" in fails(2, "run", demo, "--filter", "efk")
        stop = ["--set", "stop={metric: r_rms_m, filter: ukf, half_width: 1, at: [2]}"]
        words = fails(2, "run", demo, *stop, "--filter", "ekf")
        assert "the rule to stop watches 'ukf', which must be among the filters" in words

    def test_quiet_says_nothing_of_what_goes_well(self, demo):
        short = ["--set", "statistics.convergence_hold_s=5", "--set", "bound=false"]
        for more in ([], [], ["--runs", "6"], ["--fresh"]):
            result = invoke("run", demo, *TINY, *short, "--filter", "ekf", *more, "--quiet")
            assert (result.exit_code, result.output) == (0, "")
        assert "opposites" in fails(2, "run", demo, "-q", "-v")

    def test_quiet_still_says_what_goes_wrong(self, demo):
        wrong = ["--set", "filters.ekf.process_noise.acceleration_psd_m2_s3=1e300"]
        result = invoke("run", demo, *TINY, "--filter", "ekf", *wrong, "--quiet")
        assert result.exit_code == 1
        assert "failed" in result.stderr

    def test_verbose_tells_of_every_block(self, demo):
        result = invoke("run", demo, *TINY, "--filter", "ekf", "--verbose")
        lines = [line for line in result.stderr.splitlines() if line.startswith("done in")]
        assert sum("sensors.radar.noise.kind=mixture, runs 0 to 3, ekf" in line for line in lines) == 1
        assert sum("bound" in line for line in lines) == 2

    def test_a_chosen_place(self, demo):
        succeeds("run", demo, *TINY, "--out", "elsewhere/mine.h5", "--set", "grid={}")
        assert Path("elsewhere/mine.h5").exists()
        assert not Path("results").exists()

    def test_unknown_formats_and_axes_are_bad_arguments(self, result):
        assert "--format takes" in fails(2, "report", result, "--format", "docx")
        assert invoke("report", result, "--axes", "xyz").exit_code == 2


def test_no_result_to_report(here):
    assert "there is no result in results/" in fails(2, "report")


@pytest.mark.parametrize("command", ["report", "inspect", "export"])
def test_a_file_that_is_no_result_is_an_input_error(command, here):
    assert "missing.h5" in fails(3, command, "missing.h5")
    Path("text.h5").write_text("no result")
    assert "text.h5" in fails(3, command, "text.h5")
    assert sorted(os.listdir()) == ["text.h5"]


def test_an_unwritable_output_is_an_output_error(demo):
    Path("blocked").write_text("a file, no folder")
    assert "blocked" in fails(3, "run", demo, *TINY, "--out", "blocked/result.h5")


def test_an_interruption_says_how_to_continue(demo, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("relnav_sim.runner.run.run_campaign", interrupted)
    assert "the same command continues" in fails(130, "run", demo)


class TestNothingIsOverwritten:
    @pytest.fixture
    def precious(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        file = Path("precious.yaml")
        file.write_text("mine\n", encoding="utf-8")
        return file

    @pytest.mark.parametrize(
        "words",
        [
            ["schema", "--out", "precious.yaml"],
            ["schema", "--out", "/dev/null"],
            ["new", "precious.yaml"],
            ["new", "."],
            ["new", ""],
            ["report", "."],
            ["report", ""],
            ["run", "precious.yaml", "--out", "precious.yaml", "--fresh"],
            ["run", "precious.yaml", "--out", "."],
        ],
    )
    def test_is_refused_in_a_sentence(self, precious, words):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 2
        assert done.exception is None or isinstance(done.exception, SystemExit)
        assert precious.read_text(encoding="utf-8") == "mine\n"

    def test_overwrite_says_so(self, precious):
        assert CliRunner().invoke(app, ["schema", "--out", "precious.yaml", "--overwrite"]).exit_code == 0
        assert precious.read_text(encoding="utf-8").startswith("{")


@pytest.mark.slow
def test_one_figure_of_a_result(demo):
    succeeds("run", demo, "--out", "r.h5", *TINY)
    assert "position_start" in succeeds("figure")
    assert succeeds("figure", "r.h5", "rms", "--case", "1", "--filter", "kf") == "wrote rms.pdf\n"
    assert Path("rms.pdf").read_bytes().startswith(b"%PDF")
    assert "rms.pdf exists already" in fails(2, "figure", "r.h5", "rms")
    assert "no figure is named 'erors'; did you mean 'errors'?" in fails(2, "figure", "r.h5", "erors")
    assert "takes no run" in fails(2, "figure", "r.h5", "boxes", "--run", "1", "--out", "b.png")
    assert "ends in .pdf, .png, .svg" in fails(2, "figure", "r.h5", "rms", "--out", "rms.gif")
    assert "no case '7'" in fails(2, "figure", "r.h5", "rms", "--case", "7", "--overwrite")
