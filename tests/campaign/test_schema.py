import json
from pathlib import Path

import pytest

from relnav_sim.campaign import load_campaign
from relnav_sim.campaign.file_model import TOP_KEYS, file_shape
from relnav_sim.campaign.loader import load_document
from relnav_sim.campaign.reference import keys_of, places, renewed, shape_at
from relnav_sim.campaign.schema import MODELINE, schema_text
from relnav_sim.cli.library import library_text
from relnav_sim.filters import registry

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "campaigns").glob("*.yaml"))


@pytest.fixture(autouse=True)
def own_filters_only(monkeypatch):
    """Leave out filters of other packages and other tests: the shipped files list relnav's own."""
    own = {
        name: kind
        for name, kind in registry.filter_kinds().items()
        if kind.factory.__module__.startswith("relnav_sim.")
    }
    monkeypatch.setattr(registry, "_KINDS", own)


def test_the_shipped_schema_is_fresh():
    shipped = (ROOT / "campaigns" / "schema.json").read_text(encoding="utf-8")
    assert shipped == schema_text(), "renew it: relnav schema --out campaigns/schema.json --overwrite"


def test_the_schema_knows_every_top_key():
    schema = json.loads(schema_text())
    assert set(schema["properties"]) == set(TOP_KEYS)
    assert schema["additionalProperties"] is False


def test_every_key_says_what_it_means():
    silent = []

    def walk(node, where):
        for name, inner in node.get("properties", {}).items():
            if not inner.get("description"):
                silent.append(f"{where}.{name}")

    schema = json.loads(schema_text())
    walk(schema, "top")
    for name, node in schema["$defs"].items():
        walk(node, name)
    assert silent == []


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_campaigns_are_valid_and_name_the_schema(file):
    assert file.read_text(encoding="utf-8").splitlines()[0] == MODELINE
    campaign = load_campaign(file)
    assert campaign.name == file.stem


def test_the_template_is_valid_and_names_the_schema(tmp_path):
    text = library_text("demo", "mine")
    assert text.splitlines()[0] == MODELINE
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    assert load_campaign(tmp_path / "mine.yaml").name == "mine"


def fits(value, node, definitions):
    """Check a value against the parts of JSON Schema that pydantic writes."""
    if "$ref" in node:
        return fits(value, definitions[node["$ref"].rpartition("/")[2]], definitions)
    for word in ("anyOf", "oneOf"):
        if word in node:
            matching = sum(fits(value, choice, definitions) for choice in node[word])
            return matching == 1 if word == "oneOf" else matching >= 1
    if "const" in node:
        return value == node["const"]
    if "enum" in node:
        return value in node["enum"]
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
    kind = node.get("type")
    if kind in ("number", "integer"):
        return isinstance(value, int if kind == "integer" else int | float) and not isinstance(value, bool)
    if kind == "object":
        known, free = node.get("properties", {}), node.get("additionalProperties", True)
        free = next(iter(node.get("patternProperties", {}).values()), free)
        return (
            isinstance(value, dict)
            and all(key in value for key in node.get("required", ()))
            and all(
                fits(inner, known[key], definitions)
                if key in known
                else (free is True or (isinstance(free, dict) and fits(inner, free, definitions)))
                for key, inner in value.items()
            )
        )
    if kind == "array":
        rows, items = node.get("prefixItems", []), node.get("items", {})
        return isinstance(value, list) and all(
            fits(inner, rows[place] if place < len(rows) else items, definitions) for place, inner in enumerate(value)
        )
    return isinstance(value, kinds[kind]) if kind else True


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_campaigns_fit_the_schema(file):
    schema = json.loads((ROOT / "campaigns" / "schema.json").read_text(encoding="utf-8"))
    data = load_document(file.read_text(encoding="utf-8")).data
    assert fits(data, schema, schema["$defs"])


def test_the_schema_allows_grid_and_zip_and_refuses_unknown_keys(demo):
    schema = json.loads(schema_text())
    data = load_document(demo).data
    assert fits({**data, "zip": {"clock.step_s": [1, 2]}}, schema, schema["$defs"])
    assert not fits({**data, "gird": {}}, schema, schema["$defs"])
    assert not fits({**data, "filters": {"ekf": {"kind": "efk"}}}, schema, schema["$defs"])
    assert not fits({**data, "grid": [1]}, schema, schema["$defs"])


def test_the_documents_tables_are_fresh():
    document = (ROOT / "docs" / "campaign-file.md").read_text(encoding="utf-8")
    assert document == renewed(document), "renew them: python -m relnav_sim.campaign.reference docs/campaign-file.md"


def test_the_document_leaves_no_section_out():
    document = (ROOT / "docs" / "campaign-file.md").read_text(encoding="utf-8")
    missing = [
        f"{place}: {key.name}"
        for place in places(file_shape())
        # The document shows the keys of one kind of filter; `relnav show filter NAME` shows those of the others.
        if not place.startswith("filters.*.kind=") or place.startswith("filters.*.kind=ekf")
        for key in keys_of(shape_at(place))
        if f"| `{key.name}` | {key.takes} |" not in document
    ]
    assert missing == []
