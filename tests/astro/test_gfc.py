"""Files of gravity fields: what is read, and what is refused with file and line."""

import re

import numpy as np
import pytest

from relnav_sim import GravityField

HEAD = """free text: the radius of the Earth
radius 1.0
begin_of_head ==========
product_type gravity_field
modelname TEST
earth_gravity_constant 0.4D+15
radius 6.4e6
max_degree 2
norm fully_normalized
tide_system tide_free
end_of_head ============
"""
DATA = """gfc 0 0 1.0 0.0
gfc 1 0 0 0
gfc 1 1 0 0

gfc 2 0 -4.8D-04 0.0D+00 1e-10 0
gfc 2 2 2d-6 -1.4d-6
gfc 2 1 -3e-10 1e-9
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "field.gfc"
        path.write_text(text)
        return path

    return write


def test_head_and_coefficients(written):
    field = GravityField.load(written(HEAD + DATA), 2)
    assert (field.mu_m3_s2, field.radius_m, field.tide_system, field.name) == (4e14, 6.4e6, "tide_free", "TEST")
    assert (field.degree, field.order) == (2, 2)
    assert np.array_equal(field.C, [[1, 0, 0], [0, 0, 0], [-4.8e-4, -3e-10, 2e-6]])
    assert np.array_equal(field.S, [[0, 0, 0], [0, 0, 0], [0, 1e-9, -1.4e-6]])


def test_without_marks_and_with_what_is_usual_left_out(written):
    """No begin_of_head, no norm, no tide system, no degrees 0 and 1."""
    head = "gravity_constant 4e14\nradius 6.4e6\nmax_degree 2\nend_of_head\n"
    field = GravityField.load(written(head + DATA.split("\n", 4)[4]), 2, 1)
    assert (field.mu_m3_s2, field.tide_system, field.name, field.C[0, 0]) == (4e14, "unknown", "field", 1.0)


def test_coefficients_without_norms(written):
    """Factors by the definition: sqrt(5), sqrt(5/3), sqrt(5/12)."""
    plain = GravityField.load(written(HEAD.replace("fully_normalized", "unnormalized") + DATA), 2)
    normal = GravityField.load(written(HEAD + DATA), 2)
    factors = np.sqrt([5, 5 / 3, 5 / 12])
    np.testing.assert_allclose(plain.C[2] * factors, normal.C[2], rtol=1e-15)
    np.testing.assert_allclose(plain.S[2] * factors, normal.S[2], rtol=1e-15)


def test_a_part_that_changes_with_time_is_refused_where_it_is_needed(written):
    path = written(HEAD + DATA.replace("gfc 2 1", "gfct 2 1"))
    assert GravityField.load(path, 2, 0).order == 0
    with pytest.raises(ValueError, match=re.escape(f"{path}:18: degree 2, order 1 changes with time (gfct)")):
        GravityField.load(path, 2)


@pytest.mark.parametrize(
    "was, now, message",
    [
        ("end_of_head", "end", "field.gfc: there is no line end_of_head"),
        ("radius 6.4e6\n", "", "field.gfc: the head has no line radius"),
        ("earth_gravity_constant", "mu", "field.gfc: the head has no line earth_gravity_constant"),
        ("max_degree 2", "", "field.gfc: the head has no line max_degree"),
        ("radius 6.4e6", "radius far", "field.gfc:7: 'far' is not a number"),
        ("radius 6.4e6", "radius -6.4e6", "field.gfc:7: radius is -6.4e6; it must be positive"),
        ("fully_normalized", "schmidt", "field.gfc:9: norm is 'schmidt'; it must be fully_normalized or unnormalized"),
        ("max_degree 2", "max_degree 1", "field.gfc:8: the field has degrees up to 1, not to the 2 asked for"),
        ("gfc 2 1 -3e-10 1e-9", "", "field.gfc: there is no coefficient of degree 2, order 1"),
        ("-3e-10", "x", "field.gfc:18: 'x' is not a number"),
        ("-3e-10", "nan", "field.gfc:18: 'nan' is not a finite number"),
        ("gfc 2 1", "gfc 2 3", "field.gfc:18: the order 3 is above the degree 2"),
        ("gfc 2 1", "gfc two 1", "field.gfc:18: 'two' is not a degree or order"),
        ("gfc 2 1", "gfc 2 2", "field.gfc:18: degree 2, order 2 is given twice"),
        ("gfc 2 1 -3e-10 1e-9", "gfc 2 1 -3e-10", "field.gfc:18: this is not a record"),
        ("gfc 2 1", "what 2 1", "field.gfc:18: this is not a record"),
    ],
)
def test_what_is_wrong_is_named(was, now, message, written):
    text = HEAD + DATA
    assert was in text
    with pytest.raises(ValueError, match=re.escape(message)):
        GravityField.load(written(text.replace(was, now)), 2)


@pytest.mark.parametrize(
    "name, degree, order, message",
    [
        ("egm96", 4, 4, "there is no gravity field 'egm96': give ggm05s, or the path of a .gfc file"),
        ("nowhere.gfc", 4, 4, "nowhere.gfc: can't be read: No such file or directory"),
        ("ggm05s", 61, 61, "the field has degrees up to 60, not to the 61 asked for"),
        ("ggm05s", 4, 5, "degree is 4 and order 5"),
        ("ggm05s", -1, -1, "degree is -1 and order -1"),
    ],
)
def test_what_is_not_there_is_refused(name, degree, order, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        GravityField.load(name, degree, order)
