"""The actuator's equation of motion with its dead band and limits, used in time and for its describing function."""


def actuator_motion(
    angle: float,
    rate: float,
    command: float,
    frequency: float,
    damping: float,
    stop: float,
    fastest: float,
    deadband: float,
) -> tuple[float, float]:
    """Return rate in rad/s and acceleration in rad/s^2 of the engine; at a limit it does not move outward.

    Args:
        angle, rate: of the engine, rad and rad/s.
        command: rad; within the dead band about zero it is not felt, beyond it less by the band.
        frequency, damping: of the second-order actuator, rad/s and 1.
        stop, fastest: limits in rad and rad/s, inf for none.
        deadband: half width in rad, 0 for none.
    """
    if command > deadband:
        felt = min(command - deadband, stop)
    elif command < -deadband:
        felt = max(command + deadband, -stop)
    else:
        felt = 0.0
    acceleration = frequency * frequency * (felt - angle) - 2.0 * damping * frequency * rate
    if abs(rate) >= fastest:
        if rate > 0.0:
            rate, acceleration = fastest, min(acceleration, 0.0)
        else:
            rate, acceleration = -fastest, max(acceleration, 0.0)
    if abs(angle) >= stop and rate * angle > 0.0:
        rate = 0.0
    return rate, acceleration
