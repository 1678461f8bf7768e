"""Predicted positions and their standard deviations."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.prediction.forecast import TooShort, forecast

QUIET = np.full(2, 1e-6)
TIMES_S = np.arange(30) / 10


def test_a_straight_path_is_predicted_exactly():
    path = np.stack([5 + 2 * TIMES_S, 1 - TIMES_S], axis=1)
    found = forecast(TIMES_S, path, 3.9, QUIET)
    np.testing.assert_allclose(found.position, [12.8, -2.9])
    np.testing.assert_allclose(found.velocity, [2, -1])
    assert (found.sigma < 1e-3).all()


def test_a_prediction_does_not_depend_on_the_rate_or_on_gaps():
    rng = np.random.default_rng(1)
    times_s = np.sort(rng.uniform(0, 3, 40))
    path = np.stack([5 + 2 * times_s, 1 - times_s], axis=1)
    np.testing.assert_allclose(forecast(times_s, path, 4.0, QUIET).position, [13, -3])


def test_the_standard_deviation_is_that_of_many_predictions_of_noisy_straight_paths():
    """Of a normal distribution 68 % lie within one standard deviation and 95 % within two."""
    rng = np.random.default_rng(2)
    straight = np.stack([100 * TIMES_S, 20 * TIMES_S], axis=1)
    shares = []
    for _ in range(150):
        path = straight + rng.normal(0, 2.0, straight.shape)
        found = forecast(TIMES_S, path, 3.4, np.full(2, 0.5))
        off = np.abs(found.position + rng.normal(0, 2.0, 2) - [340, 68])
        shares.append(off / found.sigma)
    assert (np.array(shares) < 1).mean() == pytest.approx(0.70, abs=0.1)
    assert (np.array(shares) < 2).mean() > 0.9


@pytest.mark.parametrize("rate_hz", [4, 5, 6, 10, 15])
def test_a_wandering_object_is_mostly_within_two_standard_deviations_at_any_rate(rate_hz):
    """Each component of its velocity changes by 20 px/s in a second; it is seen for 3 s."""
    rng = np.random.default_rng(3)
    times_s = np.arange(0, 4, 1 / 60)
    seen = np.arange(0, 181, 60 // rate_hz)
    inside = []
    for _ in range(150):
        speeds = np.cumsum(rng.normal(0, 20 / 60**0.5, (len(times_s), 2)), axis=0)
        walk = np.cumsum(speeds / 60, axis=0)
        path = walk[seen] + rng.normal(0, 0.3, (len(seen), 2))
        wanted = seen[-1] + 36  # in 0.6 s
        found = forecast(times_s[seen], path, float(times_s[wanted]), np.full(2, 0.3))
        inside.append(np.abs(found.position - walk[wanted]) < 2 * found.sigma)
    assert np.mean(inside) > 0.75


def test_after_a_turn_the_prediction_follows_with_a_larger_deviation():
    turned = np.where(TIMES_S < 2, 100 * TIMES_S, 200.0)
    path = np.stack([turned, np.maximum(0, 100 * (TIMES_S - 2))], axis=1)
    found = forecast(TIMES_S, path, 3.4, QUIET)
    np.testing.assert_allclose(found.velocity, [0, 100], atol=1e-6)
    straight = np.stack([100 * TIMES_S, 0 * TIMES_S], axis=1)
    assert forecast(TIMES_S[:25], path[:25], 3.0, QUIET).sigma.max() > 10
    assert forecast(TIMES_S, straight, 3.4, QUIET).sigma.max() < 1


def test_a_standing_object_is_predicted_to_stand():
    found = forecast(TIMES_S, np.full((30, 2), 7.0), 12.0, QUIET)
    np.testing.assert_allclose(found.position, [7, 7])
    np.testing.assert_allclose(found.velocity, [0, 0])


def test_noise_is_the_least_standard_deviation():
    path = np.stack([TIMES_S, TIMES_S], axis=1)
    assert (forecast(TIMES_S, path, 3.0, np.array([0.5, 2.0])).sigma >= [0.5, 2.0]).all()


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_short_path_is_refused(count: int):
    with pytest.raises(TooShort, match=f"seen in {count} frames"):
        forecast(TIMES_S[:count], np.zeros((count, 2)), 1.0, QUIET)


def test_four_positions_at_equal_times_give_a_defined_result():
    found = forecast(np.zeros(4), np.ones((4, 2)), 1.0, QUIET)
    assert np.isfinite(found.position).all()
    assert np.isfinite(found.sigma).all()
