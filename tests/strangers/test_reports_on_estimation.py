"""Situations in which users of other packages met wrong estimates: repository and number of each report, the value by
a closed form.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

es = lm.estimation
ROTATIONS, PLANE = lm.SO3(), lm.SE2()
FILTERS = [es.ErrorStateFilter, es.UnscentedFilter]


def yaw(angle: float) -> Any:
    return np.asarray(ROTATIONS.exp([0.0, 0.0, angle]))


def yaw_of(g: Any) -> float:
    return float(np.arctan2(g[1, 0], g[0, 0]))


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("heading", [0.0, 0.4 * np.pi, 0.6 * np.pi, 0.99 * np.pi, -0.7 * np.pi])
def test_a_measured_attitude_weighs_half_at_every_heading(kind: Any, heading: float) -> None:
    """bitcraze/crazyflie-firmware#1292, #1531: the filter went unstable at yaws above 90 degrees, for its residual was
    composed in the other order.
    """
    filter = kind(es.Turning(ROTATIONS, [1e-3] * 3))
    belief = filter.belief(yaw(heading), [0.05] * 3)
    belief = filter.update(belief, es.Place(ROTATIONS, [0.05] * 3), yaw(heading + 0.1))
    tolerance = 1e-14 if kind is es.ErrorStateFilter else 0.05 * 0.05**2  # a cloud feels the curvature
    assert np.allclose(belief.g, yaw(heading + 0.05), rtol=0.0, atol=tolerance)
    assert np.isclose(belief.deviations[2], 0.05 / np.sqrt(2.0), rtol=1e3 * tolerance)
    assert np.allclose(belief.deviations, 0.05 / np.sqrt(2.0), rtol=1e-3)  # the reset turns the other two by 0.05 rad


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [2 / 3, -1 / 3, 2 / 3]])
def test_an_attitude_upside_down_is_the_largest_error_and_not_none(axis: Any) -> None:
    """betaflight/betaflight-configurator#5252: at 180 degrees the logarithm was zero, a perfect match."""
    filter = es.ErrorStateFilter(es.Turning(ROTATIONS, [1e-3] * 3))
    axis = np.asarray(axis)
    over = 2.0 * np.outer(axis, axis) - np.eye(3)  # by half a turn
    belief = filter.update(filter.belief(np.eye(3), [1.0] * 3), es.Place(ROTATIONS, [1.0] * 3), over)
    assert np.isclose(belief.nis, np.pi**2 / 2.0, rtol=1e-12)
    turned = np.asarray(ROTATIONS.log(belief.g))
    assert np.allclose(np.abs(turned @ axis), np.pi / 2.0, rtol=1e-7)
    assert np.allclose(np.cross(turned, axis), 0.0, atol=1e-7)


@pytest.mark.parametrize("kind", FILTERS)
def test_headings_on_both_sides_of_west_have_west_as_their_mean(kind: Any) -> None:
    """manankharwar/fusioncore#92, wpilibsuite/allwpilib#3145: angles of -pi and pi were averaged to zero."""
    filter = kind(es.Turning(PLANE, [0.2, 1e-9, 1e-9]))
    belief = filter.belief(PLANE.exp([np.pi - 0.02, 0.0, 0.0]), [0.1, 1e-3, 1e-3])
    belief = filter.update(belief, es.Place(PLANE, [0.1, 1.0, 1.0]), PLANE.exp([-np.pi + 0.02, 0.0, 0.0]))
    assert abs(abs(yaw_of(belief.g)) - np.pi) < 1e-6
    wide = filter.predict(belief, [0.0, 0.0, 0.0], 1.0)
    assert abs(abs(yaw_of(wide.g)) - np.pi) < 1e-6
    assert np.isclose(wide.deviations[0] ** 2, 0.1**2 / 2.0 + 0.2**2, rtol=1e-6)


def still(process: Any, deviations: Any, steps: int, h: float) -> Any:
    """A belief about a device that lies still, which has only looked at its accelerometer and gyroscope."""
    filter = es.ErrorStateFilter(process)
    group = process.group
    belief = filter.belief(np.asarray(group.identity()), deviations)
    for _ in range(steps):
        belief = filter.predict(belief, [0.0, 0.0, 0.0, 0.0, 0.0, 9.80665], h)
    return belief


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 40])
def test_an_accelerometer_makes_places_uncertain_by_the_cube_of_time(steps: int) -> None:
    """borglab/gtsam#368, #879: covariances of preintegrated accelerations were degenerate after a single measurement.
    White noise of density s: var v = s^2 t, cov(p, v) = s^2 t^2/2, var p = s^2 t^3/3, however many steps there are.
    """
    s, t = 0.02, 2.0
    belief = still(es.Imu([1e-12] * 3, [s] * 3), [1e-9] * 9, steps, t / steps)
    among = belief.covariance[np.ix_([5, 8], [5, 8])]  # velocity and place along the vertical
    assert np.allclose(among, s * s * t * np.array([[1.0, t / 2.0], [t / 2.0, t * t / 3.0]]), rtol=1e-6)


@pytest.mark.slow
def test_an_unknown_bias_makes_places_uncertain_by_the_square_of_time() -> None:
    """borglab/gtsam#368, #874: the effect of the bias on the position was left out.  var v = b^2 t^2, var p = b^2 t^4/4."""
    b, t = 0.01, 3.0
    process = es.BiasedImu([1e-12] * 3, [1e-12] * 3, [1e-12] * 6)
    belief = still(process, [1e-9] * 12 + [b] * 3, 20, t / 20)
    variances = np.diag(belief.covariance)[:9]
    assert np.isclose(np.sort(variances)[-1], b * b * t**4 / 4.0, rtol=1e-3)
    assert np.isclose(np.sort(variances)[-4], b * b * t**2, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", FILTERS)
def test_a_device_that_measures_no_force_falls(kind: Any) -> None:
    """borglab/gtsam#143: is gravity in it?  A force of zero means z = -g t^2/2, v = -g t."""
    process = es.Imu([1e-4] * 3, [1e-3] * 3)
    filter = kind(process)
    belief = filter.belief(np.eye(5), [1e-3] * 9)
    for _ in range(50):
        belief = filter.predict(belief, np.zeros(6), 0.02)
    columns = np.asarray(belief.g)[2, 3:]
    assert np.allclose(np.sort(columns), [-9.80665, -0.5 * 9.80665], rtol=1e-6)


def test_a_random_walk_of_a_data_sheet() -> None:
    """nmayorov/pyins#21: how do values of a data sheet become arguments?  0.012 degrees per root of an hour are 0.012
    degrees after an hour.
    """
    density = np.radians(0.012) / np.sqrt(3600.0)
    filter = es.ErrorStateFilter(es.Turning(ROTATIONS, [density] * 3))
    belief = filter.belief(np.eye(3), [1e-12] * 3)
    for _ in range(360):
        belief = filter.predict(belief, np.radians([0.0, 0.0, 0.004]), 10.0)
    assert np.allclose(np.degrees(belief.deviations), 0.012, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", FILTERS)
def test_an_attitude_does_not_depend_on_the_rate_of_samples(kind: Any) -> None:
    """arduino-libraries/MadgwickAHRS#1, psiphi75/ahrs#17: a frequency was written into the filter, so that attitudes ran
    away.
    """
    ends = []
    for steps in (10, 100):
        filter = kind(es.Turning(ROTATIONS, [1e-3, 2e-3, 3e-3]))
        belief = filter.belief(np.eye(3), [1e-3] * 3)
        for _ in range(steps):
            belief = filter.predict(belief, [0.0, 0.0, 1.5], 1.0 / steps)
        ends.append(belief)
    for belief in ends:  # the mean of an unscented cloud is off by its variance
        assert np.allclose(belief.g, yaw(1.5), rtol=0.0, atol=1e-6)
        assert np.isclose(belief.covariance[2, 2], 1e-6 + 9e-6, rtol=1e-5)


@pytest.mark.parametrize("kind", FILTERS)
def test_what_is_linear_is_kalmans_filter_written_out(kind: Any) -> None:
    """rlabbe/filterpy#172, #192: extended and unscented filters differed on a linear problem."""
    space = lm.VectorSpace(2)
    filter = kind(es.Turning(space, [0.3, 0.1]))
    start, cov = np.array([1.0, -2.0]), np.diag([0.5, 0.2]) ** 2
    belief = filter.belief(start, [0.5, 0.2])
    for z in ([1.3, -1.0], [1.9, -0.5], [2.2, 0.1]):
        belief = filter.predict(belief, [0.4, 0.8], 0.5)
        start, cov = start + 0.5 * np.array([0.4, 0.8]), cov + 0.5 * np.diag([0.3, 0.1]) ** 2
        belief = filter.update(belief, es.Place(space, [0.2, 0.4]), z)
        gain = cov @ np.linalg.inv(cov + np.diag([0.2, 0.4]) ** 2)
        start, cov = start + gain @ (np.asarray(z) - start), (np.eye(2) - gain) @ cov
    assert np.allclose(belief.g, start, rtol=1e-12) and np.allclose(belief.covariance, cov, rtol=1e-12)


def test_an_uncertain_heading_stays_about_the_vertical_of_space() -> None:
    """PX4/PX4-ECL#541, #543: when the heading was set anew, the variance of the pitch grew.  A device that lies on its
    side, x upwards, has an uncertain heading about its own x.
    """
    on_its_side = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # columns: its axes in space
    filter = es.ErrorStateFilter(es.Turning(ROTATIONS, [1e-3] * 3), side="right")
    belief = filter.belief(on_its_side, [1e-3, 1e-3, 0.5])  # about axes of space
    seen = belief.seen_from("left")
    assert np.allclose(seen.deviations, [0.5, 1e-3, 1e-3], rtol=1e-12)
    truth = np.asarray(ROTATIONS.exp([0.0, 0.0, 0.3])) @ on_its_side
    assert np.isclose(belief.nees(truth), 0.36, rtol=1e-9) and np.isclose(seen.nees(truth), 0.36, rtol=1e-9)


@pytest.mark.slow
def test_the_bias_of_a_gyroscope_is_what_it_shows_at_rest() -> None:
    """ArduPilot/ardupilot#5691: the bias that was reported had the opposite sign."""
    process = es.BiasedGyroscope([1e-4] * 3, [1e-9] * 3)
    filter = es.ErrorStateFilter(process)
    product, bias = process.group, np.array([0.01, -0.02, 0.005])
    belief = filter.belief(product.identity(), [1e-3] * 3 + [0.1] * 3)
    for _ in range(300):
        belief = filter.predict(belief, bias, 0.1)
        belief = filter.update(belief, es.OfPart(product, 0, es.Place(ROTATIONS, [1e-3] * 3)), np.eye(3))
    estimate = np.ravel(belief.g)[-3:]
    assert np.allclose(estimate, bias, rtol=0.0, atol=1e-4), estimate
