"""Files that a campaign names: where they are looked for, and what of them makes a campaign the same."""

import pytest

from relnav_sim.campaign import CampaignError, load_campaign, parse_campaign
from relnav_sim.results.changes import changed_keys

LINES = [
    "1 43476U 18047A   18365.89673225 +.00000266 +00000-0 +96631-5 0  9993",
    "2 43476 088.9970 209.2025 0019272 138.9449 221.3254 15.23792965033965",
]
OTHER = [
    "1 43477U 18047B   18365.89702718 +.00000263 +00000-0 +95755-5 0  9997",
    "2 43477 088.9971 209.2044 0019074 138.5411 221.7288 15.23793300033968",
]
FIELD = """earth_gravity_constant 3.986004415e14
radius 6378136.3
max_degree 2
norm fully_normalized
end_of_head ====
gfc 2 0 {c20} 0.0
gfc 2 1 0.0 0.0
gfc 2 2 2.43938e-06 -1.40028e-06
"""
ORBIT = "orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}"


@pytest.fixture
def written(demo, tmp_path):
    """Writes a campaign into a folder of its own, with files beside it, and loads it."""

    def write(folder, chief=ORBIT, truth="", **files):
        place = tmp_path / folder
        place.mkdir(exist_ok=True)
        for name, text in files.items():
            (place / name.replace("_", ".")).write_text(text)
        text = demo.partition("grid:")[0].replace(ORBIT, chief).replace("truth:\n", f"truth:\n{truth}")
        (place / "one.yaml").write_text(text)
        return load_campaign(place / "one.yaml")

    return write


def test_the_demo_still_says_what_is_replaced_here(demo):
    assert ORBIT in demo
    assert "truth:\n" in demo


def test_what_is_read_counts_and_not_where(written):
    quoted = ", ".join(f'"{line}"' for line in LINES)
    plain = written("a", f"tle: {{lines: [{quoted}]}}")
    here = written("b", "tle: {file: one.tle}", one_tle="\n".join(LINES))
    there = written("c", "tle: {file: the.tle, name: GRACE}", the_tle="\n".join(["GRACE", *LINES, "OTHER", *OTHER]))
    other = written("d", "tle: {file: one.tle}", one_tle="\n".join(OTHER))
    assert plain.hash == here.hash == there.hash != other.hash
    assert plain.cases[0].id == here.cases[0].id == there.cases[0].id != other.cases[0].id
    assert changed_keys(plain.content, here.content) == []
    assert changed_keys(here.content, other.content) != []


def test_a_gravity_file_is_its_content(written):
    truth = "  epoch: 2026-01-01T00:00:00 UTC\n"
    gravity = "gravity: {model: small.gfc, degree: 2}, drag: none"

    def with_field(folder, c20):
        campaign = written(folder, truth=truth, small_gfc=FIELD.format(c20=c20))
        return load_campaign(campaign.path, [f"truth.forces={{{gravity}}}"])

    one, moved, changed = (with_field(*each) for each in (("a", -4.84e-4), ("b", -4.84e-4), ("c", -4.83e-4)))
    assert one.hash == moved.hash != changed.hash
    assert one.cases[0].id == moved.cases[0].id != changed.cases[0].id
    j2 = one.cases[0].config.truth.constants.j2
    assert j2 == pytest.approx(4.84e-4 * 5**0.5, rel=1e-12)


def test_a_gravity_file_that_a_filter_believes_in_is_its_content_too(written):
    truth = "  epoch: 2026-01-01T00:00:00 UTC\n"

    def with_belief(folder, c20):
        campaign = written(folder, truth=truth, small_gfc=FIELD.format(c20=c20))
        believed = "filters.ekf.dynamics={kind: nonlinear_field, model: small.gfc, degree: 2}"
        return load_campaign(campaign.path, [believed])

    one, moved, changed = (with_belief(*each) for each in (("a", -4.84e-4), ("b", -4.84e-4), ("c", -4.83e-4)))
    assert one.hash == moved.hash != changed.hash


def test_files_may_be_varied(written, demo):
    forces = "forces: {zonals: 4, drag: exponential}"
    assert forces in demo
    files = {"small_gfc": FIELD.format(c20=-4.84e-4), "other_gfc": FIELD.format(c20=-4.83e-4)}
    made = []
    for folder in ("a", "b"):
        path = written(folder, **files).path
        text = path.read_text().replace(forces, "forces: {gravity: {model: small.gfc, degree: 2}, drag: none}")
        path.write_text(text.replace("truth:\n", "truth:\n  epoch: 2026-01-01T00:00:00 UTC\n"))
        made.append(load_campaign(path, ["grid={truth.forces.gravity.model: [small.gfc, other.gfc]}"]))
    one, other = made
    assert len({case.id for case in one.cases}) == 2
    assert (one.hash, [case.id for case in one.cases]) == (other.hash, [case.id for case in other.cases])


def test_a_missing_file_is_a_problem_with_a_line(written):
    with pytest.raises(CampaignError) as error:
        written("a", "tle: {file: none.tle}")
    (problem,) = error.value.problems
    place, _, sentence = problem.partition(": truth.chief.tle: ")
    assert place.rpartition(":")[2].isdigit()
    assert sentence.endswith("none.tle: No such file or directory")


def test_campaigns_that_vary_sections_of_the_truth_keep_their_hashes(demo):
    """As they were before epochs, fields and other ways to start were known."""
    varied = (
        "grid={truth.forces: [{zonals: 2}, {zonals: 4}], truth.chief.orbit: [{a_km: 6878, e: 0.001, i_deg: 51.6}, "
        "{a_km: 7000, e: 0, i_deg: 51.6}], truth.deputy: [{relative: {position_m: [0, 5000, 0], velocity_m_s: [0, 0, "
        "0]}, mass_kg: 10, area_m2: 1}, {orbit: {a_km: 6878, e: 0.001, i_deg: 51.6}, mass_kg: 10, area_m2: 1}], "
        "truth.dispersions: [{}, {density: {kind: normal, sigma: 0.1}}]}"
    )
    campaign = parse_campaign(demo, (varied,))
    ids = [case.id for case in campaign.cases]
    assert campaign.hash.startswith("89ce4885800b")
    assert [*ids[:3], ids[-1]] == ["01872f4c8934", "516ebb4345bc", "4a69b4005a10", "bc01c0cedcb4"]


@pytest.mark.parametrize(
    "same",
    [
        "truth.chief.reflectivity_coefficient=1.3",
        "truth.forces.third_bodies=[]",
        "truth.forces.radiation_pressure=false",
    ],
)
def test_later_defaults_written_out_change_nothing(demo, same):
    assert parse_campaign(demo, (same,)).hash == parse_campaign(demo).hash


@pytest.mark.parametrize("other", ["truth.epoch=2026-01-01T00:00:00 UTC", "truth.forces.drag=layers"])
def test_later_keys_that_say_something_do(demo, other):
    assert parse_campaign(demo, (other,)).hash != parse_campaign(demo).hash
