"""Motion along a vector of rates, scaled by a share between 0 and 1, for homing and jogging."""

from armkin.board.sim.axis_counts import Axes, limit_rule_holds, row_value

_TICK_TIME = 0.001  # length [s] of a tick


class Cruise:
    """A vector of rates and its share, updated every millisecond; at rest in the beginning."""

    def __init__(self, axes: Axes) -> None:
        self.axes = axes
        self.now = 0.0  # [s] simulated time
        self.stopped = False  # whether the motion has to end
        self.aim([0] * len(axes.base))

    def aim(self, rate: list[int]) -> None:
        """Begin a vector, at rest."""
        self.rate, self.share = rate, 0.0
        self.travel = 0.0  # counts made along the vector by its fastest axis
        self._done = [0.0] * len(rate)

    @property
    def slope(self) -> float:
        """The greatest change of the share in a second within all accelerations."""
        axes = zip(self.axes.image.axes, self.rate, strict=True)
        return min((axis.max_accel / abs(rate) for axis, rate in axes if rate), default=1e9)

    @property
    def braking_counts(self) -> float:
        """Counts that the fastest axis needs to stop."""
        return self.share**2 / (2 * self.slope) * max(abs(rate) for rate in self.rate)

    def velocity(self) -> list[float]:
        """The present velocity of every axis."""
        return [rate * self.share for rate in self.rate]

    def glide(self, target: float) -> None:
        """Move for one millisecond, with the share approaching `target`."""
        old_share, step = self.share, self.slope * _TICK_TIME
        self.share = min(old_share + step, target) if target > old_share else max(old_share - step, target)
        mean_time = (old_share + self.share) / 2 * _TICK_TIME
        self.travel += mean_time * max(abs(rate) for rate in self.rate)
        total = [old + rate * mean_time for old, rate in zip(self._done, self.rate, strict=True)]
        steps = [int(new) - int(old) for new, old in zip(total, self._done, strict=True)]
        self._done = total
        self.axes.add_steps(steps)

    def clear(self) -> bool:
        """Whether the arm stays within its limits if it brakes after the next millisecond."""
        image, base, known_axes = self.axes.image, self.axes.base, self.axes.known
        share = min(self.share + self.slope * _TICK_TIME, 1.0)
        stop_time = share * _TICK_TIME + share * share / (2 * self.slope) + share * _TICK_TIME
        stop_steps = [round(rate * stop_time + (rate > 0) - (rate < 0)) for rate in self.rate]
        stop_counts = [count + steps for count, steps in zip(base, stop_steps, strict=True)]
        for i, axis in enumerate(image.axes):
            if (
                self.rate[i]
                and known_axes >> i & 1
                and not limit_rule_holds(axis.lower, axis.upper, base[i], stop_counts[i])
            ):
                return False
        for row in image.rows:
            if all(known_axes >> i & 1 for i, weight in enumerate(row.weight) if weight) and not limit_rule_holds(
                row.lower, row.upper, row_value(row, base), row_value(row, stop_counts)
            ):
                return False
        return True
