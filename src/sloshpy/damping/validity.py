"""How large a slosh the mechanical analogue holds for, and what is said of a record beyond it."""

from sloshpy.damping.decay_result import FreeDecay

VALID_SHARE_OF_RADIUS = 0.15  # the mechanical analogue holds to 10-15 % of the tank radius
NO_MODEL_SHARE_OF_RADIUS = 0.5  # at half the radius the wave at the wall is as high as the tank is wide
_NO_MODEL = "no spring-mass describes that"
_LESS_VALID = "the spring-mass model is less valid beyond 10-15 %"

NO_RADIUS = "not checked: slosh amplitude against the tank radius, of which 10-15 % is valid (none is given)"


def words_on_radius(amplitude: float, radius: float) -> tuple[str, bool]:
    """Return what to say of a slosh amplitude in a tank, m each, and whether no model holds; "" where it is small."""
    share = amplitude / radius
    told = f"slosh of {amplitude:.3f} m is {100.0 * share:.0f} % of the tank radius"
    if share > NO_MODEL_SHARE_OF_RADIUS:
        return f"{told}: {_NO_MODEL}", True
    return (f"{told}; {_LESS_VALID}", False) if share > VALID_SHARE_OF_RADIUS else ("", False)


def check_share_of_radius(found: FreeDecay, radius: float) -> str | None:
    """Return what to know of a decay's largest amplitude in a tank of that radius in m, None where it is small.

    The amplitude is the slosh-mass displacement, or the wave at the wall where the record's scale is not known.

    Raises:
        InputError: the amplitude is beyond half the radius.
    """
    if found.per_displacement is None and found.measured == "force":
        return "not checked: slosh amplitude against the tank radius, of which 10-15 % is valid (a force has no scale)"
    largest = max(found.tested[1], float(found.envelope[0]) / (found.per_displacement or 1.0))
    what = "slosh" if found.per_displacement is not None else "a wave"
    share = largest / radius
    if share > NO_MODEL_SHARE_OF_RADIUS:
        raise found.record.refused(
            f"{what} of {largest:.4g} m",
            f"is {100.0 * share:.0f} % of the tank radius of {radius:.4g} m: {_NO_MODEL}",
            f"check the units of {found.record.column} and of the radius, or name a later --start",
        )
    if share > VALID_SHARE_OF_RADIUS:
        return f"caution: {what} of {largest:.3g} m is {100.0 * share:.0f} % of the tank radius; {_LESS_VALID}"
    return None
