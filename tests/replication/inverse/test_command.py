import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from replication.inverse.__main__ import app
from replication.inverse.findings import FILE, read_findings
from replication.inverse.page import PAGE, page_of

ROOT = Path(__file__).parents[3]


def test_the_page_is_the_committed_one() -> None:
    assert (ROOT / "docs" / PAGE).read_text(encoding="utf-8") == page_of(read_findings())


def test_findings_have_what_their_readers_take() -> None:
    for found in read_findings()["papers"].values():
        assert {"bank", "claims", "sentences", "tables", "together"} <= found.keys()
        assert "coverage" in found["checks"]
        for claim in found["claims"].values():
            low, high = claim["interval"]
            assert 0 <= low <= claim["probability"] <= high <= 1
            assert claim["sentence"]
        for table in found["tables"].values():
            for row in table["rows"]:
                assert len(row["paper"]) == len(row["alone"]) == len(row["joint_residual"])
    assert FILE.stat().st_size < 1_000_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["infer", "alpha_kf", "--out", "nowhere"], "nowhere/alpha_kf holds no bank"),
        (["bank", "alpha_kf", "--size", "150"], "give a multiple of 100"),
    ],
)
def test_a_mistake_is_one_sentence(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert words in result.output
    assert "Traceback" not in result.output


def test_the_page_is_written(tmp_path: Path) -> None:
    (tmp_path / "findings.json").write_text(json.dumps({"papers": {}}))
    result = CliRunner().invoke(app, ["page", "--docs", str(tmp_path), "--findings", str(tmp_path / "findings.json")])
    assert result.exit_code == 0
    assert (tmp_path / PAGE).read_text().startswith("# Which settings")
