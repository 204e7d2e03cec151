import pytest

from relnav_sim.campaign.loader import load_document
from relnav_sim.tuning.edit import edited, number_text, with_header

PSD = ("process_noise", "acceleration_psd_m2_s3")
HEAD = """# A small campaign.
name: small # its name
seed: 1
runs: 2
clock: {duration_s: 40, step_s: 1, store_every_s: 4}
truth:
  chief: {orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0},
          mass_kg: 200, area_m2: 1, drag_coefficient: 2.2}
  deputy: {relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}, mass_kg: 100, area_m2: 1,
           drag_coefficient: 2.2}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
statistics: {settle_s: 10}
filters:
"""


def one(text, path=PSD, value=3.16e-8, name="a"):
    return edited(HEAD + text, {("filters", name, *path): value})[len(HEAD) :]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            "  a: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 1.0e-6}} # why\n",
            "  a: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 3.16e-8}} # why\n",
        ),
        ("  a: {kind: ekf}\n", "  a: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 3.16e-8}}\n"),
        ("  a: {kind: ekf , }", "  a: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 3.16e-8} , }"),
        (
            "  a:\n    kind: ekf # the filter\n",
            "  a:\n    kind: ekf # the filter\n    process_noise: {acceleration_psd_m2_s3: 3.16e-8}\n",
        ),
        ("  a:\n    kind: ekf", "  a:\n    kind: ekf\n    process_noise: {acceleration_psd_m2_s3: 3.16e-8}"),
        (
            "  a:\n    kind: ekf\n    process_noise:\n      # why\n      acceleration_psd_m2_s3: 2e-7   # m^2/s^3\n",
            "  a:\n    kind: ekf\n    process_noise:\n      # why\n      acceleration_psd_m2_s3: 3.16e-8   # m^2/s^3\n",
        ),
        (
            "  a:\n    dynamics:\n      kind: cw\n    kind: ekf\n  b: {kind: kf}\n",
            "  a:\n    dynamics:\n      kind: cw\n    kind: ekf\n"
            "    process_noise: {acceleration_psd_m2_s3: 3.16e-8}\n  b: {kind: kf}\n",
        ),
        ('  "a": {kind: "ekf"}\n', '  "a": {kind: "ekf", process_noise: {acceleration_psd_m2_s3: 3.16e-8}}\n'),
    ],
)
def test_only_the_number_changes(before, after):
    assert one(before) == after
    assert one(before.replace("\n", "\r\n")) == after.replace("\n", "\r\n")


def test_several_numbers_of_several_filters():
    text = HEAD + "  a:\n    kind: huber\n  b: {kind: kf, r_scale: 1}\n"
    found = edited(
        text, {("filters", "a", *PSD): 1e-9, ("filters", "a", "threshold"): 2.5, ("filters", "b", "r_scale"): 12}
    )
    data = load_document(found).data["filters"]
    assert data["a"] == {"kind": "huber", "process_noise": {"acceleration_psd_m2_s3": 1e-9}, "threshold": 2.5}
    assert data["b"] == {"kind": "kf", "r_scale": 12}
    assert found.startswith(HEAD)


@pytest.mark.parametrize("value", [1e-14, 3.16e-8, 0.01, 0.5, 1.0, 12.0, 1234.0, 1e5, 1e16, 2.5e-300])
def test_numbers_are_numbers_to_every_reader(value):
    import yaml

    text = number_text(value)
    assert load_document(f"x: {text}").data["x"] == value
    assert yaml.safe_load(text) == value


def test_header_goes_behind_the_first_comments():
    assert with_header("# one\n# two\n\nname: x\n", ["tuned"]) == "# one\n# two\n#\n# tuned\n\nname: x\n"
    assert with_header("name: x\n", ["tuned", "so"]) == "# tuned\n# so\nname: x\n"
    assert with_header("# one\r\nname: x\r\n", ["tuned"]) == "# one\r\n#\r\n# tuned\r\nname: x\r\n"
