"""The filter of one axis, against the textbook's matrices."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.tracking.kalman import AxisFilter


def test_the_filter_is_the_one_of_the_textbook():
    axis = AxisFilter(3.0, -2.0, 4.0, 0.5, 9.0)
    state = np.array([3.0, -2.0])
    covariance = np.array([[4.0, 0.5], [0.5, 9.0]])
    observed = np.array([[1.0, 0.0]])
    for dt, measured in ((0.1, 2.5), (0.4, 2.0), (0.0, 2.2), (0.03, 1.0)):
        axis.predict(dt, 7.0)
        axis.correct(measured, 0.6)
        step = np.array([[1.0, dt], [0.0, 1.0]])
        noise = 49.0 * np.outer([dt * dt / 2, dt], [dt * dt / 2, dt])
        state, covariance = step @ state, step @ covariance @ step.T + noise
        gain = covariance @ observed.T / (observed @ covariance @ observed.T + 0.36)
        state = state + (gain * (measured - state[0])).ravel()
        covariance = covariance - gain @ observed @ covariance
    assert [axis.position, axis.velocity] == pytest.approx(state)
    assert [axis.pp, axis.pv, axis.vv] == pytest.approx(covariance[[0, 0, 1], [0, 1, 1]])


def test_without_process_noise_two_short_predictions_equal_a_long_one():
    one, two = AxisFilter(0, 3, 1, 0.2, 2), AxisFilter(0, 3, 1, 0.2, 2)
    one.predict(0.5, 0.0)
    two.predict(0.2, 0.0)
    two.predict(0.3, 0.0)
    assert (one.position, one.pp, one.pv) == pytest.approx((two.position, two.pp, two.pv))


def test_no_variance_is_negative_after_a_clock_was_set_forward_by_decades():
    axis = AxisFilter(100.0, 0.0, 1.0, 0.0, 900.0)
    for k in range(40):
        axis.predict(1_704_401_517.8975914 if k == 10 else 1 / 30, 45.0)
        assert min(axis.pp, axis.vv) >= 0
        axis.correct(100.0 + 3 * k, 1.5)
        assert min(axis.pp, axis.vv) >= 0


def test_an_implausible_residual_enlarges_the_covariance_until_it_is_plausible():
    axis = AxisFilter(0.0, 0.0, 1.0, 0.5, 2.0)
    axis.adapt(2.0, 1.0)  # 2 of sqrt(1 + 1): plausible
    assert (axis.pp, axis.pv, axis.vv) == (1.0, 0.5, 2.0)
    axis.adapt(6.0, 1.0)
    # 6 is 1.5 standard deviations if the variance with the measurement's 1 is (6 / 1.5)^2 = 16.
    assert (axis.pp, axis.pv, axis.vv) == pytest.approx((15.0, 7.5, 30.0))
