"""The margins of each mode by substitution into the exact loop, python-control, closed forms and brute force."""

import control
import numpy as np
import pytest

import oracle
import oracle_flexible
from cases import paper_case, random_case, real_case, xi
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.poles import unstable_count
from sloshpy.files import read_case, to_control, write_example
from sloshpy.stability import margin_table, margins
from sloshpy.vehicle import Aerodynamics, SloshMass, Vehicle

EXAMPLES = ["upper_stage", "two_tanks", "light_upper_stage", "flexible_launcher"]


def changed(case, column, value):
    pilot = case.autopilot.degraded(delay=value) if column == "delay" else case.autopilot.degraded(gain=value)
    return case.model_copy(update={"autopilot": pilot})


def growth(case, damping, column, value):
    return greatest_growth(open_loop(changed(case, column, value), damping))


def limits(table):
    """The loop's own gain up, gain down and delay margins, those that exist."""
    for column in ("gain_up", "gain_down", "delay"):
        reading = table.least(column)[1]
        if 0.0 < reading.value < np.inf:
            yield column, reading


def check_substitution(case, damping, table):
    """At the margin the loop is neutral; up to it, on a scan, it is stable; just beyond, it is not."""
    fastest = max(t.frequency for t in case.vehicle.tanks)
    for column, (value, omega) in limits(table):
        least = 1.0 if column.startswith("gain") else 0.0
        parts = np.append(np.linspace(0.0, 0.999, 8), [1.0, 1.001])
        found = growth(case, damping, column, least + parts * (value - least))
        # 1e-10: eigenvalues lose what a double pole costs; the frequency of a static crossing is 0
        assert abs(found[-2]) < 1e-10 * max(omega, fastest), (column, value)
        assert np.all(found[:-2] < 0.0), (column, value)
        assert found[-1] > 0.0, (column, value)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_are_neutral_at_their_margins_and_stable_before(name, tmp_path):
    case = read_case(write_example(name, tmp_path))
    for damping in (None, 0.03, 0.06):
        table = margin_table(case, damping)
        assert table.stable == bool(margins(case, damping).stable)
        if table.stable:
            assert len(list(limits(table))) >= 1
            check_substitution(case, damping, table)


def test_100_random_vehicles_are_neutral_at_their_margins_and_stable_before():
    """Bending, engine inertia, air, delay, each present in half of them; the unstable ones have no margins."""
    rng = np.random.default_rng(60)
    stable = checked = 0
    for _ in range(100):
        case, damping = real_case(rng)
        table = margin_table(case, damping)
        stable += table.stable
        if table.stable:
            check_substitution(case, damping, table)
            checked += len(list(limits(table)))
        else:
            for row in table.rows:
                assert np.all(np.isnan([row.gain_up.value, row.gain_down.value, row.delay.value, row.disk.value]))
                assert row.nichols.value < 0.0
    assert 30 < stable < 70
    assert checked > stable


def test_every_limit_of_every_row_brings_a_pole_out_and_every_gain_needed_brings_one_back():
    """Counted by encirclement, which knows nothing of crossings or slopes; a mode beyond the first limit too."""
    rng = np.random.default_rng(61)
    out = back = 0
    for _ in range(40):
        case, damping = real_case(rng)
        table = margin_table(case, damping)

        def grown(column, value, case=case, damping=damping):
            return unstable_count(open_loop(changed(case, column, value), damping))

        for row in table.rows:
            for column in ("gain_up", "gain_down", "delay", "gain_needed"):
                value = getattr(row, column).value
                if not 0.0 < value < np.inf:
                    continue
                least = 0.0 if column == "delay" else 1.0
                before, after = (grown(column, value + side * 1e-4 * (value - least)) for side in (-1.0, 1.0))
                assert after - before in ((-1, -2) if column == "gain_needed" else (1, 2)), (row.mode, column, value)
                out, back = out + (column != "gain_needed"), back + (column == "gain_needed")
    assert out > 50
    assert back > 8


def test_the_delay_margin_is_that_of_the_lobe_and_not_of_the_lowest_crossing(tmp_path):
    """A phase margin of 31 deg at 0.17 Hz is 0.51 s, one of 125 deg at 1.17 Hz 0.30 s; -55 deg wraps to 305 deg."""
    table = margin_table(read_case(write_example("flexible_launcher", tmp_path)))
    assert table.least("delay")[0] == "first bending"
    assert table.row("rigid body").phase_lag.value < table.row("first bending").phase_lag.value
    lox = table.row("core LOX slosh")
    assert np.degrees(lox.phase_lag.value) == pytest.approx(360.0 - 54.56, abs=0.01)
    assert np.degrees(lox.phase_lead.value) == pytest.approx(16.905, abs=0.001)
    assert lox.delay.value == pytest.approx(lox.phase_lag.value / lox.delay.omega, rel=1e-12)


def test_phase_margins_are_those_of_a_constant_rotation():
    """exp(-j phi) L has a point on -1 at the margin; the Nyquist count of the rotated upper half says which side."""
    rng = np.random.default_rng(62)
    checked = 0
    for _ in range(30):
        case, damping = random_case(rng)
        table = margin_table(case, damping)
        if not table.stable:
            continue
        c = oracle.numbers(case, damping)
        for sign, column in ((-1.0, "phase_lag"), (1.0, "phase_lead")):
            phi, omega = table.least(column)[1]
            if np.isfinite(phi):
                assert abs(1.0 + np.exp(sign * 1j * phi) * oracle.loop(c, np.array([1j * omega]))[0]) < 1e-8
                gain, _ = oracle.crossings(c, np.geomspace(0.03 * c.w.min(), 30 * c.w.max(), 50_001))
                every = np.angle(-oracle.loop(c, 1j * gain)) * -sign % (2.0 * np.pi)
                assert phi >= np.min(every) - 1e-6
                checked += 1
    assert checked > 12


def test_modulus_and_disk_margins_agree_with_python_control_on_rational_loops():
    """T08: in minimal form, drift removed by structure; its disk margin on our frequencies among its grid."""
    rng = np.random.default_rng(63)
    cases = [(paper_case(), np.array([x])) for x in (0.03, 0.048)]
    while len(cases) < 20:
        case, damping = random_case(rng, delay=False)
        if margins(case, damping).stable:
            cases.append((case, damping))
    for case, damping in cases:
        table = margin_table(case, damping)
        loop = to_control(open_loop(case, damping))
        at = [r.omega for row in table.rows for r in (row.modulus, row.disk) if np.isfinite(r.omega)]
        w0 = max(t.frequency for t in case.vehicle.tanks)
        grid = np.unique(np.concatenate([np.geomspace(0.01 * w0, 30.0 * w0, 4_000), at]))
        alpha, gain_db, phase_deg = control.disk_margins(loop, grid, skew=0.0)
        mode, ours = table.least("disk")
        assert ours.value == pytest.approx(float(np.squeeze(alpha)), rel=1e-6)
        ratio, phase = table.row(mode).disk_guarantee
        assert 20.0 * np.log10(ratio) == pytest.approx(float(np.squeeze(gain_db)), rel=1e-6)
        assert np.degrees(phase) == pytest.approx(float(np.squeeze(phase_deg)), rel=1e-6)
        least = np.min(np.abs(1.0 + loop(1j * grid)))
        assert table.least("modulus")[1].value == pytest.approx(min(least, 1.0), rel=1e-6)  # |1 + L| ends at 1


def test_the_modulus_margin_is_that_of_stability_margins():
    """T10: 0.489 at 4.8 %, beside a disc margin of 1.018 and a disk margin of 0.613 (5.5 dB, 34.1 deg)."""
    num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.048))
    theirs = control.stability_margins(control.tf(np.polymul(num, [0.14, 0.08]), den))[2]
    row = margin_table(paper_case(), 0.048).row("LOX slosh")
    assert row.modulus.value == pytest.approx(theirs, rel=1e-6)
    assert row.modulus.value == pytest.approx(0.489, abs=5e-4)
    assert row.nichols.value == pytest.approx(1.018, abs=5e-4)
    assert row.disk.value == pytest.approx(0.613, abs=5e-4)
    assert 20 * np.log10(row.disk_guarantee[0]) == pytest.approx(5.5, abs=0.05)
    assert np.degrees(row.disk_guarantee[1]) == pytest.approx(34.1, abs=0.05)


def test_no_point_of_a_brute_force_curve_is_nearer_than_the_least_of_the_rows():
    """Vehicles with everything; 20000 points and more about every closed-loop pole of the oracle."""
    rng = np.random.default_rng(64)
    seen = 0
    for _ in range(40):
        case, damping = real_case(rng)
        table = margin_table(case, damping)
        if not table.stable:
            continue
        p = oracle_flexible.second_order(case.vehicle, damping)
        poles = oracle_flexible.poles(p, case.autopilot.model_copy(update={"delay": 0.0}))
        size = np.abs(poles)[np.abs(poles) > 1e-9 * np.abs(poles).max()]
        near = [abs(q.imag) + abs(q.real) * np.linspace(-8, 8, 801) for q in poles if q.imag > 0]
        grid = np.concatenate([np.geomspace(0.01 * size.min(), 10 * size.max(), 20_000), *near])
        L = oracle_flexible.solved(p, case.autopilot, 1j * np.unique(grid[grid > 0]))[0]
        for column, curve in (("modulus", np.abs(1 + L)), ("disk", 2 * np.abs(1 + L) / np.abs(1 - L))):
            ours, theirs = table.least(column)[1].value, float(np.min(curve))
            assert ours <= theirs * (1 + 1e-7), (column, ours, theirs)
            assert ours >= theirs * (1 - 1e-2), (column, ours, theirs)  # the grid's own coarseness
            seen += 1
    assert seen > 30


def test_the_nichols_column_holds_every_minimum_of_margins():
    rng = np.random.default_rng(65)
    for _ in range(25):
        case, damping = real_case(rng, air=False)
        table, found = margin_table(case, damping), margins(case, damping)
        mode = [found.groups[int(k)] for k in found.mode(found.minima)]
        for row in table.rows:
            own = [v for v, name in zip(found.minima.value, mode, strict=True) if name == row.mode and np.isfinite(v)]
            expected = min(own, default=np.inf) * (1.0 if found.stable else -1.0)
            assert row.nichols.value == pytest.approx(expected, rel=1e-9)


def bare(arm, speed=600.0):
    """A rigid vehicle in air without tanks; the centre of pressure lies `arm` ahead of the c.g."""
    case = paper_case(gain=3.0)
    air = Aerodynamics(normal_force_slope=2e5, center_of_pressure=6.0 + arm, speed=speed)
    given = {k: getattr(case.vehicle, k) for k in type(case.vehicle).model_fields}
    return case.model_copy(update={"vehicle": Vehicle(**given | {"tanks": (), "aerodynamics": air})})


def test_the_aerodynamic_gain_margin_of_a_rigid_vehicle_is_the_closed_form():
    """T11. Ahead of the c.g. and fast: phi'' = mu phi - c2 beta, so that the gain may fall to mu / (c2 a0).

    Behind the c.g. the drift into the wind diverges without oscillation: at rest Z' and phi balance where
    L(0) = a0 R' Xcp / (arm (F - D)).
    """
    ahead = bare(4.0, speed=1e9)  # no drift into the wind within the time of the attitude
    mu, c2 = 2e5 * 4.0 / 9e5, 9e5 * 6.0 / 9e5
    table = margin_table(ahead)
    assert table.rows[0].mode == "aerodynamic"
    assert table.growing >= 1
    assert table.rows[0].gain_down.value == pytest.approx(mu / (c2 * 0.08 * 3.0), rel=1e-6)
    behind = bare(-4.0)
    table = margin_table(behind)
    row = table.rows[0]
    static = 3.0 * 0.08 * 9e5 * 2.0 / (-4.0 * 9e5)
    if static > -1.0:
        assert row.label == "unstable"
        assert row.gain_needed.value == pytest.approx(-1.0 / static, rel=1e-9)
        assert row.gain_needed.omega == 0.0


def test_a_statically_stable_loop_with_enough_gain_may_lose_it_down_to_the_static_crossing():
    case = changed(bare(-1.0), "gain", 2.0)
    row = margin_table(case).rows[0]
    static = 6.0 * 0.08 * 9e5 * 5.0 / (-1.0 * 9e5)
    assert (row.mode, row.gain_down.omega) == ("aerodynamic", 0.0)
    assert row.gain_down.value == pytest.approx(-1.0 / static, rel=1e-9)
    assert growth(case, None, "gain_down", row.gain_down.value * 0.999) > 0.0
    assert growth(case, None, "gain_down", row.gain_down.value * 1.001) < 0.0


def test_random_flying_vehicles_have_an_aerodynamic_row_exactly_where_the_broken_loop_grows():
    rng = np.random.default_rng(66)
    rows = limited = 0
    for _ in range(25):
        case, damping = real_case(rng, air=True)
        table = margin_table(case, damping)
        p = oracle_flexible.second_order(case.vehicle, damping)
        off = case.autopilot.model_copy(update={"gain": 1e-12, "delay": 0.0})
        assert table.growing == int(np.sum(oracle_flexible.poles(p, off).real > 1e-7))
        assert (table.rows[0].mode == "aerodynamic") == (table.growing > 0)
        rows += table.growing > 0
        limited += table.stable and table.growing > 0 and table.rows[0].gain_down.value > 0.0
        if table.stable and table.growing and table.least("gain_down")[1].value == 0.0:
            assert growth(case, damping, "gain_down", 0.0101) < 0.0  # lost, but more than 40 dB below
    assert rows > 10
    assert limited > 5


def test_lobes_are_labelled_by_their_peak():
    """The oracle's curve about the tank's frequency: its greatest local maximum, and whether it is above 0 dB."""
    for ratio, label in ((0.012, "gain-stabilised"), (0.0005, "phase-stabilised")):
        case = paper_case(xi(ratio), tank={"slosh_mass": 400.0, "station": 17.0})
        row = margin_table(case).row("LOX slosh")
        w = 2.0 * (1 + np.linspace(-0.2, 0.2, 400_001))
        size = np.abs(oracle.loop(oracle.numbers(case, ratio), 1j * w))
        maxima = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
        top = maxima[np.argmax(size[maxima])]
        assert (size[top] < 1.0) == (label == "gain-stabilised")
        assert row.label == label
        assert row.peak.value == pytest.approx(size[top], rel=1e-6)
        assert row.peak.omega == pytest.approx(w[top], rel=1e-4)
        L = oracle.loop(oracle.numbers(case, ratio), np.array([1j * row.peak.omega]))[0]
        assert np.exp(1j * row.peak_phase) == pytest.approx(L / abs(L), abs=1e-9)


def test_a_gain_stabilised_mode_stays_stable_whatever_phase_its_lobe_gets():
    """Any turn confined to the lobe leaves the winding about -1 as it is."""
    case = paper_case(xi(0.05), tank={"slosh_mass": 400.0, "station": -6.0})
    c = oracle.numbers(case, 0.05)
    assert margin_table(case).row("LOX slosh").label == "gain-stabilised"
    w = np.unique(np.concatenate([np.geomspace(1e-3, 200.0, 200_001), 2.0 * (1 + np.linspace(-0.3, 0.3, 40_001))]))
    L = oracle.loop(c, 1j * w)
    for phi in np.linspace(0.0, 2.0 * np.pi, 13):
        # the turn is confined to the lobe, between the rigid crossover and far above
        turned = L * np.exp(-1j * phi * np.exp(-((np.log(w / 2.0) / 0.25) ** 2)))
        count = np.sum(np.angle((1 + turned[1:]) / (1 + turned[:-1])))
        plain = np.sum(np.angle((1 + L[1:]) / (1 + L[:-1])))
        assert count == pytest.approx(plain, abs=1e-3)


def test_the_unstable_mode_is_named_and_another_one_is_not():
    table = margin_table(paper_case(), 0.01)
    assert table.row("LOX slosh").label == "unstable"
    assert table.row("rigid body").label == ""
    assert str(table).startswith("UNSTABLE, grows at 0.02976 1/s")
    assert not table.stable


def test_a_neutral_loop_has_no_margin():
    from scipy.optimize import brentq

    neutral = brentq(lambda x: float(greatest_growth(open_loop(paper_case(), x))), 0.02, 0.03, xtol=1e-15)
    table = margin_table(paper_case(), neutral)
    assert str(table).startswith("NEUTRAL")
    assert table.row("LOX slosh").label == "neutral"
    assert np.isnan(table.row("LOX slosh").delay.value)


def test_tanks_in_another_order_give_the_same_rows():
    rng = np.random.default_rng(67)
    case, damping = random_case(rng, tanks=3, delay=True)
    vehicle = case.vehicle.model_copy(update={"tanks": case.vehicle.tanks[::-1]})
    turned = margin_table(case.model_copy(update={"vehicle": vehicle}), damping[::-1])
    plain = margin_table(case, damping)
    for row in plain.rows:
        other = turned.row(row.mode)
        assert (other.label, other.kind) == (row.label, row.kind)
        np.testing.assert_allclose(other.peak, row.peak, rtol=1e-6)
        np.testing.assert_allclose(other.nichols.value, row.nichols.value, rtol=1e-8)


def test_the_table_fits_on_a_screen_and_goes_to_a_dataset(tmp_path):
    table = margin_table(read_case(write_example("flexible_launcher", tmp_path)))
    text = str(table)
    assert max(len(line) for line in text.splitlines()) <= 132
    for word in ("-18.07", "+1.88", "first bending", "gain-stabilised", "2 poles grow in the broken loop"):
        assert word in text
    data = table.to_dataset()
    assert data["gain_up"].sel(mode="core LOX slosh") == table.row("core LOX slosh").gain_up.value
    assert data["delay"].attrs["units"] == "s"
    assert data["delay_omega"].attrs["units"] == "rad/s"


def test_a_batch_is_refused():
    tank = SloshMass(name="b", slosh_mass=np.array([50.0, 60.0]), station=9.0, frequency=3.0, damping=xi(0.01))
    with pytest.raises(ValueError, match="one case"):
        margin_table(paper_case(more=(tank,)))
