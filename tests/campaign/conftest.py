from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def demo() -> str:
    return (ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8")
