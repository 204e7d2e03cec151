from typing import get_args

import pytest

from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options
from relnav_sim.tuning.scalars import Scalar, TuningError, free_scalars, marked, with_values

PSD = "process_noise.acceleration_psd_m2_s3"


def names(found):
    return {filter: [scalar.name for scalar in scalars] for filter, scalars in found.items()}


def test_declared_numbers(make_campaign):
    campaign = make_campaign("filters.h={kind: huber}", "filters.a={kind: adaptive_alpha_kf}")
    assert names(free_scalars(campaign)) == {
        "kf": [PSD, "r_scale"],
        "ekf": [PSD],
        "h": [PSD, "threshold"],
        "a": [PSD, "degrees_of_freedom"],  # not those of the schemes that are not in use
    }
    # By the error alone a factor on R says no more than the process noise.
    assert names(free_scalars(campaign, objective="position"))["kf"] == [PSD]


def test_every_declared_range_is_taken_by_its_filter(make_campaign):
    for name, kind in filter_kinds().items():
        if any(True for _ in marked(kind.options_model)):
            free_scalars(make_campaign(f"filters.x={{kind: {name}}}"), ("x",))


def field_at(model, path):
    """Return the field of an options model, or of a section in it that may be left out."""
    *sections, last = path
    for key in sections:
        annotation = model.model_fields[key].annotation
        (model,) = (
            one for one in (annotation, *get_args(annotation)) if isinstance(one, type) and issubclass(one, Options)
        )
    return model.model_fields[last]


def test_every_mark_stands_on_a_number_with_its_default_in_range():
    for kind in filter_kinds().values():
        assert issubclass(kind.options_model, Options)
        for path, mark in marked(kind.options_model):
            field = field_at(kind.options_model, path)
            assert mark.low < mark.high, (kind.name, path)
            assert field.is_required() or mark.low <= field.default <= mark.high, (kind.name, path)


def test_named_numbers(make_campaign):
    campaign = make_campaign()
    found = free_scalars(campaign, free={"filters.kf.r_scale": (0.5, 8.0)})
    assert found["kf"] == (Scalar(("r_scale",), 0.5, 8.0, True, True),)
    assert names(found)["ekf"] == [PSD]
    found = free_scalars(campaign, ("kf",), {"filters.kf.r_scale": None}, "position")
    assert names(found) == {"kf": ["r_scale"]}
    found = free_scalars(campaign, ("ekf",), {"filters.kf.r_scale": (0.5, 8.0)})
    assert names(found) == {"ekf": [PSD]}


def test_what_the_grid_varies_is_not_free(make_campaign):
    campaign = make_campaign(f"grid={{filters.kf.{PSD}: [1.0e-6, 1.0e-7]}}")
    assert names(free_scalars(campaign)) == {"kf": ["r_scale"], "ekf": [PSD]}
    with pytest.raises(TuningError, match="varied by the campaign's grid"):
        free_scalars(campaign, free={f"filters.kf.{PSD}": None})


@pytest.mark.parametrize(
    ("filters", "free", "words"),
    [
        (("efk",), {}, "no filter is named 'efk'; did you mean 'ekf'"),
        ((), {"filters.ekf.alpha": (0.1, 1)}, "no number of this campaign"),
        ((), {"clock.step_s": (0.1, 1)}, "no number of a filter"),
        ((), {"filters.ekf.dynamics.kind": (0.1, 1)}, "no number of this campaign"),
        ((), {"filters..": None}, "is not a path"),
        ((), {"filters.kf.r_scale": (2, 1)}, "the range 2 to 1"),
        ((), {"filters.kf.r_scale": (-1, 1)}, "does not take -1: input should be greater than 0"),
        (("ekf",), {"filters.kf.nope": None}, "no number of this campaign"),
    ],
)
def test_what_cannot_be_tuned(make_campaign, filters, free, words):
    with pytest.raises(TuningError, match=words):
        free_scalars(make_campaign(), filters, free)


def test_a_matrix_is_no_number(make_campaign):
    campaign = make_campaign("filters.ekf.process_noise={diagonal: [0, 0, 0, 1.0e-6, 1.0e-6, 1.0e-6]}")
    assert "ekf" not in free_scalars(campaign)
    with pytest.raises(TuningError, match="has no free number"):
        free_scalars(campaign, ("ekf",))


def test_values_at_places():
    scalar = Scalar(("a",), 1e-14, 1e-2, True)
    assert [scalar.value(u) for u in (0, 0.5, 1)] == [1e-14, 1e-8, 1e-2]
    assert scalar.place(1e-8) == pytest.approx(0.5)
    assert scalar.place(0.0) == 0
    assert Scalar(("a",), 0, 2, False).value(1 / 3) == 0.667


def test_entry_with_other_numbers(make_campaign):
    entry = make_campaign().cases[0].config.filters["kf"]
    changed = with_values(entry, {("r_scale",): 3.0, ("process_noise", "acceleration_psd_m2_s3"): 2e-9})
    assert (changed.r_scale, changed.process_noise.acceleration_psd_m2_s3) == (3.0, 2e-9)
    assert type(changed) is type(entry)
