import numpy as np
import pytest

from relnav_sim.plots.axes import (
    AXIS_COMPONENTS,
    checked_axes,
    describe_axes,
    source_component,
    turned_sigmas,
    turned_states,
)

# Rows: along-track, minus orbit normal, nadir, in RTN (radial, along-track, normal).
SHI_FROM_RTN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


def test_shi2025_is_the_rotation_of_its_definition() -> None:
    states = np.random.default_rng(1).normal(size=(4, 5, 6))
    expected = np.concatenate([states[..., :3] @ SHI_FROM_RTN.T, states[..., 3:] @ SHI_FROM_RTN.T], axis=-1)
    np.testing.assert_array_equal(turned_states(states, "shi2025"), expected)
    assert np.linalg.det(SHI_FROM_RTN) == pytest.approx(1.0)  # right-handed


def test_sigmas_change_places_but_no_signs() -> None:
    sigmas = np.arange(1.0, 7.0)
    covariance = np.diag(sigmas[:3] ** 2)
    turned = np.sqrt(np.diag(SHI_FROM_RTN @ covariance @ SHI_FROM_RTN.T))
    np.testing.assert_allclose(turned_sigmas(sigmas, "shi2025")[:3], turned)
    np.testing.assert_array_equal(turned_sigmas(sigmas, "shi2025"), [2, 3, 1, 5, 6, 4])


def test_rtn_leaves_everything_as_stored() -> None:
    states = np.arange(6.0)
    np.testing.assert_array_equal(turned_states(states, "rtn"), states)
    assert all(source_component(name, "rtn") == (name, 1.0) for name in (*AXIS_COMPONENTS, "r", "v"))


def test_components_agree_with_the_states() -> None:
    states = np.arange(1.0, 7.0)
    turned = turned_states(states, "shi2025")
    for index, name in enumerate(AXIS_COMPONENTS):
        source, sign = source_component(name, "shi2025")
        assert turned[index] == sign * states[AXIS_COMPONENTS.index(source)]
    assert source_component("r", "shi2025") == ("r", 1.0)


def test_axes_are_described_and_checked() -> None:
    assert describe_axes("rtn") == "Chief's RTN frame: x radial, y along-track, z orbit normal"
    assert describe_axes("shi2025").endswith("x along-track, y minus orbit normal, z nadir")
    with pytest.raises(ValueError, match="rtn, shi2025, not 'ecef'"):
        checked_axes("ecef")
