"""A second opinion on a whole assessment: everything it says is put into the equations of `oracle_flexible`.

Nothing is shared with the package but the numbers under test. The curve L(j omega) is sampled from clusters about the
plant's poles and halved until its logarithm moves by little; each minimum of eq 24 is refined by SciPy; whose it is
is found by moving each frequency of the vehicle a little. A requirement is not searched for again: just above it and
at many larger dampings the loop must be good, and just below it must not.
"""

from collections import Counter

import numpy as np
import scipy.optimize

import oracle_flexible as second

MOST = 0.3  # beyond it nothing is slosh
LEVELS = np.geomspace(1e-4, MOST, 13)


def distance(L, criteria):
    """Eq 24."""
    return np.hypot(np.log(np.abs(L)) / np.log(criteria.gain_margin), np.angle(-L) / criteria.phase_margin)


def response(case, xi, omega, pilot=None):
    """L and z/beta on the axis."""
    L, z, _ = second.solved(second.second_order(case.vehicle, xi), pilot or case.autopilot, 1j * omega)
    return L, z


def curve(case, xi):
    """Frequencies and L so dense that ln L moves by less than 0.03 between neighbours."""
    p = second.second_order(case.vehicle, xi)
    n = len(p.b0)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [np.linalg.solve(p.E2, -p.E0), np.linalg.solve(p.E2, -p.E1)]])
    poles = np.linalg.eigvals(A)
    poles = poles[(poles.imag > 0) & (np.abs(poles) > 1e-3 * min(t.frequency for t in case.vehicle.tanks))]
    own = np.array([t.frequency for t in case.vehicle.tanks] + [f.frequency for f in case.vehicle.flexible_modes])
    offset = np.maximum(np.abs(poles.real), 1e-8 * np.abs(poles))[:, None] * np.geomspace(0.3, 1e4, 40)
    near = np.concatenate([poles.imag[:, None] - offset, poles.imag[:, None] + offset]).ravel()
    omega = np.concatenate([np.geomspace(2e-3 * own.min(), 1e2 * own.max(), 600), near])
    omega = np.unique(omega[(omega > 2e-3 * own.min()) & (omega < 1e2 * own.max())])
    L = second.solved(p, case.autopilot, 1j * omega)[0]
    for _ in range(25):
        step = np.abs(np.log(L[1:] / L[:-1]))
        k = np.flatnonzero((step > 0.03) & (np.diff(omega) > 1e-10 * omega[1:]))
        # beyond this nothing is near the critical point
        k = k[(np.minimum(np.abs(np.log(np.abs(L[k]))), np.abs(np.log(np.abs(L[k + 1])))) < 4.0)]
        if not len(k):
            break
        middle = 0.5 * (omega[k] + omega[k + 1])
        L = np.insert(L, k + 1, second.solved(p, case.autopilot, 1j * middle)[0])
        omega = np.insert(omega, k + 1, middle)
    return omega, L


def minima(case, xi, below=1.6):
    """Frequencies and values of the local minima of eq 24 below a level."""
    omega, L = curve(case, xi)
    DM = distance(L, case.criteria)
    low = np.flatnonzero(np.minimum(DM[1:], DM[:-1]) < below)  # there also the shallowest dip counts
    more = omega[low, None] + np.diff(omega)[low, None] * np.arange(1, 8) / 8
    omega = np.unique(np.concatenate([omega, more.ravel()]))
    # nearer ones differ by rounding, unless a tank's damping makes the curve as narrow
    apart = np.clip(1e-2 * np.min(xi[xi > 0.0], initial=1.0), 1e-11, 1e-8)
    omega = omega[np.append(True, np.diff(omega) > apart * omega[:-1])]
    DM = distance(response(case, xi, omega)[0], case.criteria)
    k = 1 + np.flatnonzero((DM[1:-1] <= DM[:-2]) & (DM[1:-1] < DM[2:]) & (DM[1:-1] < below))
    found = []
    for i in k:

        def value(x):
            return float(distance(response(case, xi, np.array([np.exp(x)]))[0], case.criteria)[0])

        ends = np.log(omega[i - 1]), np.log(omega[i + 1])
        best = scipy.optimize.minimize_scalar(value, bounds=ends, method="bounded", options={"xatol": 1e-12})
        found.append((float(np.exp(best.x)), min(float(best.fun), float(DM[i]))))
    return found


def moved(case, group, factor):
    """The case with the frequency of one tank or bending mode multiplied."""
    v, n = case.vehicle, len(case.vehicle.tanks)
    tanks, modes = list(v.tanks), list(v.flexible_modes)
    nouns, k = (tanks, group) if group < n else (modes, group - n)
    nouns[k] = nouns[k].model_copy(update={"frequency": nouns[k].frequency * factor})
    vehicle = v.model_copy(update={"tanks": tuple(tanks), "flexible_modes": tuple(modes)})
    return case.model_copy(update={"vehicle": vehicle})


def shares(case, xi, omega):
    """How a neutral frequency at omega follows the frequency of each tank and bending mode; the rest last."""
    h, at = 1e-5, np.array([omega])

    def L(one, s):
        return second.solved(second.second_order(one.vehicle, xi), case.autopilot, s)[0][0]

    slope = (L(case, 1j * at * (1 + h)) - L(case, 1j * at * (1 - h))) / (2 * h)
    count = len(case.vehicle.tanks) + len(case.vehicle.flexible_modes)
    own = [(L(moved(case, g, 1 + h), 1j * at) - L(moved(case, g, 1 - h), 1j * at)) / (2 * h) for g in range(count)]
    part = [-(d / slope).real for d in own]
    for j, tank in enumerate(case.vehicle.tanks):  # far below its frequency the mass follows the body
        part[j] *= omega >= 0.3 * tank.frequency
    return np.array([*part, 1.0 - sum(part)])


def belongs(share, *tanks):
    """Whether a minimum is one tank's of some: its share is at least half of the greatest, within what h can tell."""
    return any(share[j] > 0 and share[j] >= 0.5 * share.max() for j in tanks)


def doubtful(share, tank):
    """Whether the differences cannot tell whose a minimum is."""
    return abs(share[tank] - 0.5 * share.max()) < 1e-3 * np.abs(share).max()


def good(case, xi, tanks, slack):
    """Whether the loop is stable and no minimum of the tanks lies below the criterion; None where one cannot tell."""
    if not second.stable(second.second_order(case.vehicle, xi), case.autopilot):
        # through the critical point itself: another tank's requirement holds the loop at neutral
        return None if min((value for _, value in minima(case, xi, 0.1)), default=1.0) < 1e-5 else False
    for omega, value in minima(case, xi, below=case.criteria.disc_margin + 0.05):
        share = shares(case, xi, omega)
        if value < case.criteria.disc_margin - slack and belongs(share, *tanks):
            return None if all(doubtful(share, j) for j in tanks if belongs(share, j)) else False
    return True


def over(case, xi, tank, low, high):
    """Frequencies of an interval, L and z/beta of a tank, so dense that ln z moves by less than 0.01: at a zero near
    the axis its phase turns, however narrow the zero."""
    omega = np.linspace(low, high, 4001)
    L, z = response(case, xi, omega)
    for _ in range(40):
        step = np.abs(np.log(z[1:, tank] / z[:-1, tank]))
        k = np.flatnonzero((step > 0.01) & (np.diff(omega) > 1e-12 * omega[1:]))
        if not len(k):
            break
        middle = 0.5 * (omega[k] + omega[k + 1])
        more = response(case, xi, middle)
        omega, L, z = (np.insert(x, k + 1, new, axis=0) for x, new in zip((omega, L, z), (middle, *more), strict=True))
    return omega, L, z[:, tank]


def law_amplitude(law, ratio):
    """The amplitude at which a power law gives a ratio."""
    return (ratio / law.slope) ** (1.0 / law.exponent)


def is_cycle(case, cycle, pilot):
    """How far a listed cycle misses L = -1 with every tank at its own damping, and its amplitudes each other."""
    omega = 2 * np.pi * cycle["frequency_hz"]
    tanks = case.vehicle.tanks
    A = np.array([cycle["slosh_amplitude_m"][t.name] for t in tanks])
    # the law states the ratio for oscillation at the tank's own frequency: xi = f(W A / w)
    xi = [t.damping.slope * (a * omega / t.frequency) ** t.damping.exponent for t, a in zip(tanks, A, strict=True)]
    L, z = response(case, xi, np.array([omega]), pilot)
    z = np.abs(z[0])
    return max(
        abs(L[0] + 1), np.abs(z / z.max() - A / A.max()).max(), abs(cycle["tvc_amplitude_rad"] * z.max() / A.max() - 1)
    )


def joint_is_right(case, joint, expect, tally):
    """Whether the laws, read at one common amplitude, give these dampings, are good from there on and not below."""
    laws = [t.damping for t in case.vehicle.tanks]
    every = range(len(laws))
    if len(laws) < 2:
        expect("joint damping", joint == [0.0])
        return
    most = max(law_amplitude(law, MOST) for law in laws)
    read = [law_amplitude(law, xi) for law, xi in zip(laws, joint, strict=True) if xi < MOST * (1 - 1e-9)]

    def at(amplitude):
        return np.minimum([law.slope * amplitude**law.exponent for law in laws], MOST)

    def verdict(amplitude, slack):
        return good(case, at(amplitude), every, slack)

    if not read:  # at the amplitude at which every law gives the most
        expect("no joint damping suffices", verdict(0.98 * most, 1e-4) is not True or verdict(most, 1e-4) is not True)
        return
    a = read[0]
    expect("joint damping", np.allclose(at(a), joint, rtol=1e-9, atol=0.0))
    for amplitude in np.geomspace(max(1.02 * a, 1e-4 * most), most, 7):
        expect("joint good above", verdict(amplitude, 1e-4) is not False)
    if a > 0.0:
        inside = minima(case, at(a), below=case.criteria.disc_margin + 0.05)
        reached = any(abs(value - case.criteria.disc_margin) < 1e-6 for _, value in inside)
        beside = 1e-3 if reached else 2e-2
        tally["joint margin reached to 1e-6" if reached else "joint stability or the end of a minimum"] += 1
        expect("joint good just above", verdict(a * (1 + beside), 1e-6) is not False)
        expect("joint bad just below", max(joint) < 1e-8 or verdict(a * (1 - beside), 1e-9) is not True)


def compare(case, review, joint, tally):
    """Compare the JSON of an assessment with the equations; return the complaints, count what was checked in `tally`.

    joint: the dampings at which the other tanks were held for the five steps.
    """
    n, criteria, bad = len(case.vehicle.tanks), case.criteria, []

    def expect(what, true):
        tally[what] += 1
        if not true:
            bad.append(what)

    joint_is_right(case, joint, expect, tally)
    small = np.zeros(n)  # power laws damp nothing
    expect("stable", review["stable"] == second.stable(second.second_order(case.vehicle, small), case.autopilot))
    listed = [(2 * np.pi * m["frequency_hz"], m["disc_margin"]) for m in review["minima"]]
    for omega, value in listed:
        L = response(case, small, np.array([omega]))[0]
        expect("value of a minimum", abs(distance(L, criteria)[0] - value) < 1e-8 * max(1, value))
    reasons = []
    for omega, value in minima(case, small):
        expect("minimum listed", min((abs(value - v) + abs(w / omega - 1) for w, v in listed), default=9.0) < 1e-3)
        share = shares(case, small, omega)
        clear = not any(doubtful(share, j) for j in range(n))
        if value < criteria.disc_margin - 1e-6 and clear and not any(belongs(share, j) for j in range(n)):
            reasons.append("a mode that is no slosh is short of the disc margin")
    if case.vehicle.aerodynamics is not None:  # air makes the gain at rest finite, and it may be the nearest
        slowest = 1e-7 * min(t.frequency for t in case.vehicle.tanks)
        if distance(response(case, small, np.array([slowest]))[0], criteria)[0] < criteria.disc_margin - 1e-6:
            reasons.append("the static gain is short of the disc margin")
    unsupported = False
    for j, (tank, told) in enumerate(zip(case.vehicle.tanks, review["tanks"], strict=True)):
        needed, cycle = told["required_damping_together"], told["limit_cycle"]
        # the tanks whose minima its requirement counts, as far as where all of them meet the margin; and what its
        # five steps rest on: that, where its own minimum becomes another's, else its own minima alone
        count = [j, *(k for k, t in enumerate(case.vehicle.tanks) if t.name in told["shared_with"])]
        used = cycle["required_damping"]

        def damped(ratio, j=j):
            return np.where(np.arange(n) == j, ratio, joint)

        if needed is None:
            # a shallow minimum that ends there is seen sharply by neither side
            verdicts = [good(case, damped(level), count, 1e-4) for level in (0.98 * MOST, MOST)]
            expect("no damping suffices", not all(verdict is True for verdict in verdicts))
            reasons.append("no damping suffices")
            expect("acceptable", cycle["acceptable"] is False)
            continue
        for level in LEVELS[needed * 1.02 < LEVELS]:
            expect("good above", good(case, damped(level), count if level < joint[j] else [j], 1e-4) is not False)
        for level in LEVELS[(used * 1.02 < LEVELS) & (needed * 1.02 >= LEVELS)] if used is not None else ():
            expect("good above its own", good(case, damped(level), [j], 1e-4) is not False)
        if needed == 0.0:
            expect("acceptable", cycle["acceptable"] is True)
            continue
        omega = 2 * np.pi * cycle["frequency_hz"] if cycle["frequency_hz"] else np.nan
        there = np.array([np.inf])
        if cycle["frequency_hz"] and used == needed:
            there = response(case, damped(needed), np.array([omega]))[0]
        reached = distance(there[0], criteria) - criteria.disc_margin
        # a margin reached is exact; stability, or the end of a shallow minimum, is seen sharply by neither side
        # what another tank asks for is always a margin reached
        beside = 1e-3 if abs(reached) < 1e-6 or len(count) > 1 else 2e-2
        tally["margin reached to 1e-6" if beside < 1e-2 else "stability or the end of a minimum"] += 1
        tally["requirement shared with another tank"] += len(count) > 1
        expect("good just above", good(case, damped(needed * (1 + beside)), count, 1e-6) is not False)
        # a joint requirement of one tank leaves another one at the criterion already, with next to no damping
        # and a minimum may hardly move with the damping of a tank: its value is good to rounding
        expect("bad just below", needed < 1e-8 or good(case, damped(needed * (1 - beside)), count, 1e-9) is not True)
        if len(count) > 1:  # its own minima alone would let it be less, and then another tank is short
            expect("shared for a reason", good(case, damped(needed * (1 - beside)), [j], 1e-9) is not False)
        if cycle["tvc_amplitude_rad"] is None:
            unsupported |= cycle["acceptable"] is None
            continue
        A = law_amplitude(tank.damping, used) * tank.frequency
        ends = 2 * np.pi * np.array(cycle["band_hz"])
        inside, L, z = over(case, damped(used), j, *ends)
        near = distance(L, criteria) <= criteria.limit_cycle_disc_margin * (1 + 1e-9)
        tvc = (A / inside / np.abs(z))[near]
        expect("slosh amplitude", abs(cycle["slosh_amplitude_m"] * omega / A - 1) < 1e-9)
        expect("engine amplitude", abs(tvc.max() / cycle["tvc_amplitude_rad"][1] - 1) < 1e-3)
        pilot = (
            case.autopilot.degraded(10 ** (cycle["gain_db"] / 20), cycle["delay_s"])
            if cycle["delay_s"] + case.autopilot.delay >= 0
            else None
        )
        for one in cycle["coupled"]:
            expect("coupled cycle", is_cycle(case, one, pilot) < 1e-6)
        worst = max([tvc.max(), *(c["tvc_amplitude_rad"] for c in cycle["coupled"] if c["stable"])])
        if abs(worst / criteria.tvc_amplitude - 1) > 1e-3:  # the samples decide no closer call
            if worst > criteria.tvc_amplitude:
                expect("acceptable", cycle["acceptable"] is False)
            else:
                expect("acceptable", cycle["acceptable"] is not False)
        unsupported |= cycle["acceptable"] is None
        if cycle["acceptable"] is False:
            reasons.append("the engine moves too much")
    for one in review["limit_cycles"] or ():
        expect("cycle as given", is_cycle(case, one, case.autopilot) < 1e-6)
        if one["stable"] and one["tvc_amplitude_rad"] > criteria.tvc_amplitude:
            reasons.append("the cycle as given moves the engine too much")
    axis = 1e-9 * max(t.frequency for t in case.vehicle.tanks)
    reasons += [
        "a mode that grows, or that no pole is found for"
        for m in review["modes"]
        if m["kind"] != "slosh" and (m["growth_rate"] or 0.0) >= -axis
    ]
    unsupported |= review["limit_cycles"] is None
    expect("verdict", review["verdict"] == ("fail" if reasons else "invalid" if unsupported else "pass"))
    tally[f"verdict {review['verdict']}"] += 1
    return bad


def tally():
    """An empty count of comparisons."""
    return Counter()
