"""Position and velocity along one axis, estimated from measurements at any times."""

from __future__ import annotations

from dataclasses import dataclass

PLAUSIBLE_SIGMAS = 1.5
"""A residual of more standard deviations than this says that the motion has changed."""

MOST_FADING = 100.0


@dataclass(slots=True)
class AxisFilter:
    """A Kalman filter of constant velocity, disturbed by a random acceleration.

    Source: R. E. Kalman, "A new approach to linear filtering and prediction problems", 1960; the
    noise is that of a piecewise constant acceleration.

    Attributes:
        position: In pixels.
        velocity: In pixels per second.
        pp: Variance of the position; ``pv`` is its covariance with the velocity, and ``vv`` the
            variance of the velocity.
    """

    position: float
    velocity: float
    pp: float
    pv: float
    vv: float

    def predict(self, dt_s: float, acceleration: float) -> None:
        """Go on for some seconds, with a random acceleration of this standard deviation."""
        q = acceleration * acceleration
        dt2 = dt_s * dt_s
        self.position += self.velocity * dt_s
        self.pp += 2 * dt_s * self.pv + dt2 * self.vv + q * dt2 * dt2 / 4
        self.pv += dt_s * self.vv + q * dt2 * dt_s / 2
        self.vv += q * dt2

    def adapt(self, measured: float, deviation: float) -> None:
        """Trust the prediction less if a measured position is far from it.

        So it follows what turns about or bounces. Source: D. H. Zhou and P. M. Frank, "Strong
        tracking filtering of nonlinear time-varying stochastic systems with coloured noise", 1996:
        the covariance is multiplied by a factor that makes the residual plausible.
        """
        noise = deviation * deviation
        if self.pp <= 0:
            return
        factor = ((measured - self.position) ** 2 / PLAUSIBLE_SIGMAS**2 - noise) / self.pp
        if factor > 1:
            factor = min(factor, MOST_FADING)
            self.pp *= factor
            self.pv *= factor
            self.vv *= factor

    def correct(self, measured: float, deviation: float) -> None:
        """Include a measured position of this standard deviation, in pixels."""
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
