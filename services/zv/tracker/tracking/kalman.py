"""A Kalman filter for position and velocity along one axis, with measurements at any times."""

from __future__ import annotations

from dataclasses import dataclass

PLAUSIBLE_SIGMAS = 1.5
"""A residual of more standard deviations than this means that the motion has changed."""

MOST_FADING = 100.0
MOST_VARIANCE = 1e12
"""Upper limit of the velocity's variance in ``adapt``: it would grow for ever if different
positions were measured without time between them."""


@dataclass(slots=True)
class AxisFilter:
    """A Kalman filter with a constant-velocity model.

    Source: R. E. Kalman, "A new approach to linear filtering and prediction problems", 1960; the
    process noise is a piecewise constant, random acceleration.
    """

    position: float  # pixels
    velocity: float  # pixels per second
    pp: float  # variance of the position
    pv: float  # covariance of position and velocity
    vv: float  # variance of the velocity

    def predict(self, dt_s: float, acceleration: float) -> None:
        """Predict the state some seconds ahead; ``acceleration`` is the standard deviation."""
        q = acceleration * acceleration
        dt2 = dt_s * dt_s
        self.position += self.velocity * dt_s
        self.pp += 2 * dt_s * self.pv + dt2 * self.vv + q * dt2 * dt2 / 4
        self.pv += dt_s * self.vv + q * dt2 * dt_s / 2
        self.vv += q * dt2

    def adapt(self, measured: float, deviation: float) -> None:
        """Enlarge the covariance if a measured position is far from the predicted one.

        The filter then follows objects that turn back or bounce. Source: D. H. Zhou and
        P. M. Frank, "Strong tracking filtering of nonlinear time-varying stochastic systems with
        coloured noise", 1996: the covariance is multiplied by a factor that makes the residual
        plausible.
        """
        noise = deviation * deviation
        if self.pp <= 0:
            return
        factor = ((measured - self.position) ** 2 / PLAUSIBLE_SIGMAS**2 - noise) / self.pp
        if factor > 1:
            factor = min(factor, MOST_FADING, max(1.0, MOST_VARIANCE / max(self.vv, 1.0)))
            self.pp *= factor
            self.pv *= factor
            self.vv *= factor

    def correct(self, measured: float, deviation: float) -> None:
        """Update the state with a measured position and its standard deviation, pixels."""
        gain_sum = self.pp + deviation * deviation
        if gain_sum <= 0:
            return
        to_position, to_velocity = self.pp / gain_sum, self.pv / gain_sum
        residual = measured - self.position
        self.position += to_position * residual
        self.velocity += to_velocity * residual
        self.vv = max(0.0, self.vv - to_velocity * self.pv)
        self.pv *= 1 - to_position
        self.pp *= 1 - to_position
