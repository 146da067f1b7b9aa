"""Modes are followed as the oracle follows them step by step; veering is told from crossing (T13)."""

import numpy as np
import pytest

import oracle
from cases import paper_case, real_case, xi
from sloshpy.autopilot import Filter
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.files import read_case, write_example
from sloshpy.stability import track_modes
from sloshpy.stability.follow import station
from sloshpy.stability.mode_shape import modal_assurance
from sloshpy.vehicle import SloshMass

ENDS = (1.7, 2.5)  # rad/s, of LH2; LOX closes at 2.07


def swept(case, tank, **fields):
    """The case with fields of one tank replaced by arrays."""
    tanks = list(case.vehicle.tanks)
    tanks[tank] = tanks[tank].model_copy(update=fields)
    return case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tuple(tanks)})})


@pytest.fixture(scope="module")
def two_tanks(tmp_path_factory):
    return read_case(write_example("two_tanks", tmp_path_factory.mktemp("case")))


def continued(case, tank, grid, start, damping):
    """A pole followed by the oracle's Newton in small steps of one tank's frequency."""
    pole, path = start, []
    for w in grid:
        pole = oracle.newton_pole(oracle.numbers(swept(case, tank, frequency=float(w)), damping), pole)
        path.append(pole)
    return np.array(path)


def test_two_tanks_whose_frequencies_cross_exchange_modes_and_the_modes_do_not_cross(two_tanks):
    """T13. The oracle follows both poles in 2000 steps and finds the same ends and the same least gap."""
    w = np.linspace(*ENDS, 17)
    found = track_modes(swept(two_tanks, 1, frequency=w), w, 0.03, name="LH2 frequency", unit="rad/s")
    fine = np.linspace(*ENDS, 2001)
    paths = [continued(two_tanks, 1, fine, found.pole[0, n], 0.03) for n in (0, 1)]
    for n in (0, 1):
        np.testing.assert_allclose(found.pole[:, n], paths[n][::125], rtol=1e-8)
    (veering,) = found.veering
    gap = np.abs(paths[1].imag - paths[0].imag)
    assert np.all(paths[1].imag > paths[0].imag)  # never cross
    assert veering.gap == pytest.approx(gap.min(), rel=1e-4)
    assert veering.at == pytest.approx(fine[np.argmin(gap)], abs=1e-3)
    assert veering.start <= veering.at <= veering.end
    assert (veering.modes, veering.tanks) == ((0, 1), ("LH2", "LOX"))
    assert found.label[0][:2] == ("LH2 slosh", "LOX slosh")
    assert found.label[-1][:2] == ("LOX slosh", "LH2 slosh")
    assert "modes 1 and 2 exchange tanks (LH2 and LOX) between LH2 frequency = 2.05 and 2.1 rad/s" in str(found)
    assert f"gap {gap.min() / (2 * np.pi):.4f} Hz" in str(found)
    assert not found.unresolved


def test_two_cases_alone_are_followed_as_well_as_two_hundred_although_their_shapes_say_crossing(two_tanks):
    """Across the whole range each tank's shape is found again with MAC > 0.9 on the other branch."""
    w = np.array(ENDS)
    found = track_modes(swept(two_tanks, 1, frequency=w), w, 0.03)
    many = np.linspace(*ENDS, 200)
    fine = track_modes(swept(two_tanks, 1, frequency=many), many, 0.03)
    np.testing.assert_allclose(found.pole[-1], fine.pole[-1], rtol=1e-9)
    ends = [station(swept(two_tanks, 1, frequency=x), np.full(2, 0.03)) for x in ENDS]
    mac = modal_assurance(ends[0].shape, ends[1].shape)
    for n in (0, 1):
        k = int(np.argmin(np.abs(ends[0].value - found.pole[0, n])))
        alike = ends[1].value[int(np.argmax(mac[k]))]
        assert mac[k].max() > 0.9
        assert abs(alike - found.pole[-1, n]) > 0.1 * abs(alike)  # the branch has become the other tank's
    assert len(found.veering) == len(fine.veering) == 1
    assert found.veering[0].gap == pytest.approx(fine.veering[0].gap, rel=1e-4)


def test_a_tank_that_hardly_couples_crosses_with_another_damping_and_veers_with_the_same(two_tanks):
    """A gram of liquid: with 1 % and 5 % damping the poles pass at a distance in growth and keep their tanks."""
    w = np.linspace(1.9, 2.3, 5)
    for ratios, exchanges in (([0.01, 0.05], 0), ([0.05, 0.01], 0)):
        found = track_modes(swept(two_tanks, 1, frequency=w, slosh_mass=1e-3), w, np.array(ratios))
        assert len(found.veering) == exchanges
        assert not found.unresolved
        for n in (0, 1):
            assert len({row[n] for row in found.label}) == 1
        lighter = found.pole[:, found.label[0].index("LH2 slosh")]
        np.testing.assert_allclose(lighter, w * (-ratios[1] + 1j * np.sqrt(1 - ratios[1] ** 2)), rtol=1e-5)
    free = oracle.newton_pole(oracle.numbers(swept(two_tanks, 1, slosh_mass=1e-9), [0.03, 0.03]), 2.07j)
    level = -free.real / abs(free)  # the damping at which the light tank's pole would run through the other's
    w = np.abs(free) * np.array([0.9, 1.13])
    found = track_modes(swept(two_tanks, 1, frequency=w, slosh_mass=3.0), w, np.array([0.03, level]))
    assert len(found.veering) == 1
    assert found.veering[0].gap < 0.03 * abs(free)


def test_poles_of_every_point_are_those_of_its_own_case_on_random_vehicles():
    """Bending, air, engines, delay; nothing lost, nothing invented, batch or sequence."""
    rng = np.random.default_rng(80)
    for k in range(8):
        case, damping = real_case(rng, delay=k % 2 == 1)
        w = case.vehicle.tanks[0].frequency * np.linspace(0.8, 1.2, 5)
        batch = track_modes(swept(case, 0, frequency=w), w, damping)
        singles = [swept(case, 0, frequency=float(x)) for x in w]
        listed = track_modes(singles, w, damping)
        np.testing.assert_array_equal(batch.pole, listed.pole)
        for p, single in enumerate(singles):
            alone = closed_loop_poles(open_loop(single, damping))
            ours = np.sort_complex(batch.pole[p][np.isfinite(batch.pole[p])])
            np.testing.assert_allclose(ours, np.sort_complex(alone.value[np.isfinite(alone.value)]), rtol=1e-12)
            named = {(name, round(v.imag, 9)) for name, v in zip(alone.name, alone.value, strict=True)}
            there = np.flatnonzero(np.isfinite(batch.pole[p]))
            assert {(batch.label[p][n], round(batch.pole[p, n].imag, 9)) for n in there} <= named


def test_branches_are_continuous_where_the_parameter_is_refined():
    """Each branch of 5 cases is found again, point by point, in one of 81."""
    rng = np.random.default_rng(81)
    for _ in range(4):
        case, damping = real_case(rng, tanks=2, delay=False)
        ends = case.vehicle.tanks[1].frequency * np.array([0.85, 1.15])
        ends = np.sort(np.append(ends, case.vehicle.tanks[0].frequency * np.array([0.9, 1.1])))[[0, -1]]
        few, many = (np.linspace(*ends, n) for n in (5, 81))
        coarse, fine = (track_modes(swept(case, 0, frequency=w), w, damping) for w in (few, many))
        assert not coarse.unresolved
        first = [int(np.argmin(np.abs(fine.pole[0] - v))) for v in coarse.pole[0][np.isfinite(coarse.pole[0])]]
        whole = [n for n in range(len(first)) if np.all(np.isfinite(fine.pole[:, first[n]]))]
        assert len(whole) >= 2
        for n in whole:
            np.testing.assert_allclose(coarse.pole[:, n], fine.pole[::20, first[n]], rtol=1e-9)


def test_tanks_in_another_order_and_the_way_back_give_the_same_branches(two_tanks):
    w = np.linspace(*ENDS, 9)
    plain = track_modes(swept(two_tanks, 1, frequency=w), w, 0.03)
    vehicle = two_tanks.vehicle.model_copy(update={"tanks": two_tanks.vehicle.tanks[::-1]})
    turned = track_modes(swept(two_tanks.model_copy(update={"vehicle": vehicle}), 0, frequency=w), w, 0.03)
    np.testing.assert_allclose(turned.pole, plain.pole, rtol=1e-9)
    assert turned.label == plain.label
    np.testing.assert_allclose(turned.participation[..., ::-1], plain.participation, atol=1e-6)
    back = track_modes(swept(two_tanks, 1, frequency=w[::-1].copy()), -w[::-1], 0.03)
    np.testing.assert_allclose(back.pole[::-1], plain.pole, rtol=1e-9)
    assert back.veering[0].gap == pytest.approx(plain.veering[0].gap, rel=1e-5)


def test_two_real_poles_that_become_a_pair_end_a_branch_and_leave_nothing_unresolved(two_tanks):
    gain = np.linspace(0.5, 3.0, 6)
    case = two_tanks.model_copy(update={"autopilot": two_tanks.autopilot.model_copy(update={"gain": gain})})
    found = track_modes(case, gain, name="gain")
    assert not found.unresolved
    begun = [n for n in range(found.pole.shape[1]) if np.isnan(found.pole[0, n])]
    assert len(begun) == 1  # at high gain the rigid body's pair has become two real poles
    assert np.sum(found.pole[-1].imag == 0.0) == 2
    assert "only" in str(found)


def test_what_cannot_be_interpolated_is_unresolved_and_not_guessed(two_tanks):
    notch = Filter(numerator=(1.0, 0.2, 400.0), denominator=(1.0, 20.0, 400.0))
    other = swept(two_tanks, 1, frequency=2.5)
    other = other.model_copy(update={"autopilot": other.autopilot.model_copy(update={"filter": (notch,)})})
    found = track_modes([swept(two_tanks, 1, frequency=1.7), other], np.array([0.0, 1.0]), 0.03, name="time", unit="s")
    ((start, end, reason),) = found.unresolved
    assert (start, end) == (0.0, 1.0)
    assert "filter has 0 and 1 entries" in reason
    assert not found.veering
    lost = np.isnan(found.pole[1]) & np.isfinite(found.pole[0])
    assert lost[0]  # a slosh mode, from 1.7 to 2.07 rad/s in one step
    assert "unresolved between time = 0 and 1 s" in str(found)
    # a step that needs no interpolation does not need alike cases
    near = swept(two_tanks, 1, frequency=1.7001)
    near = near.model_copy(update={"autopilot": near.autopilot.model_copy(update={"rate_gain": 0.1401})})
    assert not track_modes([swept(two_tanks, 1, frequency=1.7), near], np.array([0.0, 1.0]), 0.03).unresolved


def test_an_impossible_vehicle_between_two_possible_ones_is_unresolved():
    """A light tank far ahead, a heavy one at the c.g.: halfway m/M + m l^2/I is 0.29 + 1.54."""
    light = {"slosh_mass": 300.0, "station": 40.0, "frequency": 1.0}
    heavy = {"slosh_mass": 9000.0, "station": 6.5, "frequency": 4.0}
    found = track_modes([paper_case(xi(0.05), tank=tank) for tank in (light, heavy)], np.array([0.0, 1.0]))
    assert found.unresolved
    assert "impossible" in found.unresolved[0][2]
    assert "indefinite" in found.unresolved[0][2]


def test_equal_tanks_on_the_same_place_are_followed_by_their_common_and_their_opposed_mode():
    """Opposed, they do not move the vehicle: that pole is the free oscillator's at every point."""
    twin = SloshMass(name="twin", slosh_mass=500.0, station=9.0, frequency=2.0, damping=xi(0.03))
    w = np.linspace(1.8, 2.2, 5)
    case = paper_case(xi(0.03), tank={"slosh_mass": 500.0}, more=(twin,))
    case = swept(swept(case, 0, frequency=w), 1, frequency=w)
    found = track_modes(case, w)
    assert not found.unresolved
    free = w * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
    assert np.min(np.max(np.abs(found.pole - free[:, None]), axis=0)) < 1e-9


def test_damping_may_change_along_the_way(two_tanks):
    ratios = np.array([[0.01, 0.02], [0.03, 0.03], [0.05, 0.04]])
    found = track_modes([two_tanks] * 3, np.arange(3.0), ratios)
    for p in range(3):
        alone = closed_loop_poles(open_loop(two_tanks, ratios[p])).value
        np.testing.assert_allclose(np.sort_complex(found.pole[p]), np.sort_complex(alone), rtol=1e-12)
    np.testing.assert_array_equal(found.damping, ratios)


def test_a_dataset_holds_branches_labels_and_shares(two_tanks):
    w = np.linspace(2.0, 2.2, 3)
    data = track_modes(swept(two_tanks, 1, frequency=w), w, 0.03, name="LH2 frequency", unit="rad/s").to_dataset()
    assert data["omega"].attrs["units"] == "rad/s"
    assert data["parameter"].attrs["long_name"] == "LH2 frequency"
    assert data.attrs["exchanges"] == "1 and 2"
    assert np.all(data["participation"].sel(mode=[1, 2]).sum("tank") > 0.9)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [([1.0, 2.0], "3 finite, increasing"), ([1.0, 1.0, 2.0], "increasing"), ([1.0, np.nan, 2.0], "finite")],
)
def test_a_parameter_that_does_not_fit_is_refused(two_tanks, parameter, message):
    with pytest.raises(ValueError, match=message):
        track_modes(swept(two_tanks, 1, frequency=np.array([2.0, 2.1, 2.2])), np.array(parameter))


def test_what_is_no_axis_is_refused(two_tanks):
    with pytest.raises(ValueError, match="batch shape"):
        track_modes(two_tanks, np.array([1.0]))
    with pytest.raises(ValueError, match="two cases or more"):
        track_modes([two_tanks], np.array([1.0]))
    batch = swept(two_tanks, 1, frequency=np.array([2.0, 2.1]))
    with pytest.raises(ValueError, match="is a batch"):
        track_modes([two_tanks, batch], np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="same tanks"):
        track_modes([two_tanks, paper_case()], np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="rows for 2 cases"):
        track_modes([two_tanks, two_tanks], np.array([1.0, 2.0]), np.full((3, 2), 0.01))
