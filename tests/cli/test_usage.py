"""Mistakes in the arguments: one sentence that names the option, and exit code 2."""

import pytest
from typer.testing import CliRunner

from relnav_sim.cli.app import app


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("run a.yaml --runs 0", "relnav: --runs must be at least 1, not '0'; relnav run --help lists its options"),
        ("tune a.yaml --runs 1", "relnav: --runs must be at least 2, not '1'; relnav tune --help lists its options"),
        ("run a.yaml --runs x", "relnav: --runs must be a whole number, not 'x'; relnav run --help lists its options"),
        ("report --axes up", "relnav: --axes: 'up' is not one of 'rtn', 'shi2025'; relnav report --help lists"),
        ("run --nope", "relnav: no such option: --nope; relnav run --help lists its options"),
        ("run a.yaml --rums 5", "relnav: no option is named --rums; did you mean --fresh or --runs?"),
        ("run", "relnav: missing argument 'FILE'; relnav run --help lists its options"),
        ("run a b", "(b); relnav run --help lists its options"),
        ("--nope", "relnav: no such option: --nope; relnav --help lists its options"),
    ],
)
def test_a_mistake_is_one_sentence(line: str, said: str) -> None:
    result = CliRunner().invoke(app, line.split())
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert "Usage" not in result.output


def test_no_command_shows_the_help() -> None:
    assert "Usage: relnav" in CliRunner().invoke(app, []).output
