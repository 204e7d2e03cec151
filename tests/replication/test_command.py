"""`python -m replication`: mistakes are told in a sentence before anything is computed."""

import pytest
from typer.testing import CliRunner

from replication.__main__ import app


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--full", "--trial"], "exclude each other"),
        (["--campaigns", "nowhere"], "there is no folder nowhere"),
        (["--in-full", "nowhere"], "--in-full goes with --docs"),
        (["--docs", "docs", "--full"], "--docs runs nothing"),
        (["--docs", "docs", "--out", "here"], "--docs runs nothing"),
        (["--full", "--nosuch"], "relnav: no option is named --nosuch; did you mean --out?"),
        (["--full", "nosuch"], "relnav: got unexpected extra argument(s) (nosuch); reproduce --help lists its options"),
        (["--in-full", "nowhere", "--docs", "docs"], "nowhere is no folder that make reproduce-full has written"),
    ],
)
def test_mistakes_are_told(arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, arguments, prog_name="reproduce")
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert "Usage" not in result.stderr
    assert not list(tmp_path.iterdir())


def test_flags_have_no_type_in_help():
    words = CliRunner().invoke(app, ["--help"]).stdout
    assert "--full" in words and "<bool>" not in words


def test_a_missing_campaign_file_is_told_before_any_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaigns").mkdir()
    result = CliRunner().invoke(app, ["--trial"])
    assert result.exit_code == 3
    assert "two_step.yaml" in result.stderr
    assert not list((tmp_path / "results").rglob("*.h5"))
