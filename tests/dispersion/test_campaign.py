"""A campaign's rows are those of the verbs and of a case alone, bit for bit; lost cases are listed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from uncertain import RUN, factor, stage

from cases import lawful_case, paper_case, random_case, real_case, xi
from sloshpy.autopilot import Actuator, Filter
from sloshpy.batch import case_shape
from sloshpy.damping import PowerDamping
from sloshpy.dispersion import Dispersion, Linear, Nonlinear, campaign_dataset, drawn, findings, rerun, run_campaign
from sloshpy.dispersion.answers import answered, step_of
from sloshpy.dispersion.columns import columns_of
from sloshpy.dispersion.many_required import many_required
from sloshpy.dispersion.rows import Status
from sloshpy.dispersion.varied import varied
from sloshpy.dispersion.verdict import verdicts
from sloshpy.dynamics import open_loop
from sloshpy.errors import InputError
from sloshpy.limit_cycle import predict_limit_cycle
from sloshpy.simulation import simulate, simulate_ensemble
from sloshpy.stability import loop_required_damping, margins, required_damping
from sloshpy.vehicle import SloshMass


def by_hand(draw):
    """The paper's stage with one draw put in, damping factor apart."""
    mass, inertia, frequency, _, gain = draw
    return paper_case(
        vehicle={"mass": 1.6e4 * mass, "inertia": 9e5 * inertia},
        tank={"frequency": 2.0 * frequency},
        rate_gain=0.14 * gain,
    )


def test_a_linear_row_is_what_the_verbs_say_of_that_case():
    d = stage()
    rows, draws = answered(d, 5, 0, 6), drawn(d, 5, 0, 6)
    for value, draw in zip(rows.values, draws, strict=True):
        f, case = draw[3], by_hand(draw)
        found, needed = margins(case, damping=0.1 * 0.5 * f), required_damping(case)
        assert value[0] == pytest.approx(float(found.nichols_disc_margin), rel=1e-12)
        assert value[1] == pytest.approx(float(found.growth), rel=1e-12)
        assert value[2] == pytest.approx(float(needed.required), rel=1e-9)
        scaled = by_hand(draw).vehicle.tanks[0].model_copy(update={"damping": PowerDamping(slope=0.1 * f)})
        vehicle = case.vehicle.model_copy(update={"tanks": (scaled,)})
        cycle = predict_limit_cycle(case.model_copy(update={"vehicle": vehicle}))
        assert value[3] == pytest.approx(cycle.slosh_amplitude, rel=1e-6)
        assert cycle.tvc_amplitude[0] * (1.0 - 1e-9) <= value[4] <= cycle.tvc_amplitude[1] * (1.0 + 1e-9)


def test_a_nonlinear_row_is_what_the_simulation_shows_of_that_case():
    d = stage(Nonlinear(duration=300.0, initial_slosh=0.3, gain=1.2, delay=0.05))
    rows, draw = answered(d, 5, 0, 3), drawn(d, 5, 0, 3)[2]
    tank = by_hand(draw).vehicle.tanks[0].model_copy(update={"damping": PowerDamping(slope=0.1 * draw[3])})
    case = by_hand(draw)
    case = case.model_copy(
        update={
            "vehicle": case.vehicle.model_copy(update={"tanks": (tank,)}),
            "autopilot": case.autopilot.degraded(1.2, 0.05),
        }
    )
    run = simulate(case, 300.0, 0.3, step=0.02)
    assert rows.values[2, 0] == pytest.approx(run.slosh_envelope().amplitude, rel=1e-4)
    assert rows.values[2, 2] == pytest.approx(run.tvc_envelope.amplitude, rel=1e-4)


@pytest.mark.parametrize("analysis", [Linear(amplitude=0.5), RUN])
def test_a_case_has_the_same_bits_in_any_block_and_alone(analysis):
    d = stage(analysis)
    whole = answered(d, 9, 0, 40)
    for first, count in ((0, 1), (17, 1), (39, 1), (10, 13)):
        part = answered(d, 9, first, count)
        assert np.array_equal(part.values, whole.values[first : first + count], equal_nan=True)
        assert part.reasons == whole.reasons[first : first + count]
    one = rerun(d, 9, 17)
    assert np.array_equal(one.values[0], whole.values[17], equal_nan=True)
    assert not np.array_equal(rerun(d, 10, 17).values[0], whole.values[17], equal_nan=True)


def test_required_damping_of_many_is_that_of_each():
    rng = np.random.default_rng(6)
    cases = [random_case(rng, tanks=1 + k % 2)[0] for k in range(6)] + [real_case(rng, tanks=2)[0]]
    found = 0
    for case in cases:
        f = rng.uniform(0.95, 1.05, 4)
        tanks = tuple(t.model_copy(update={"frequency": t.frequency * f}) for t in case.vehicle.tanks)
        batch = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tanks})})
        for j in range(len(tanks)):
            loop = open_loop(batch)
            required, omega = many_required(loop, case.criteria, j)
            for k in range(4):
                one = loop_required_damping(loop.take(np.array([k])), case.criteria, j, case.criteria.disc_margin)
                np.testing.assert_allclose(required[k], one.required[0], rtol=1e-7, atol=1e-13)
                np.testing.assert_allclose(omega[k], one.omega[0], rtol=1e-5)
                found += 0.01 < required[k] < 1.0
    assert found > 5


def test_a_draw_that_makes_no_vehicle_is_listed_and_counts_as_worst():
    heavy = paper_case(tank={"slosh_mass": 5000.0, "station": 12.0})  # m/M + m l^2/I = 0.51; more is no vehicle
    d = stage(case=heavy, parameters=(factor("tank.LOX.slosh_mass", 0.99),), analysis=Linear(amplitude=0.5))
    campaign = run_campaign(d, 60, 4)
    lost = np.flatnonzero(campaign.status == Status.FAILED)
    share = drawn(d, 4, 0, 60)[:, 0] * (5000.0 / 1.6e4 + 5000.0 * 36.0 / 9e5)
    assert np.array_equal(lost, np.flatnonzero(share >= 1.0))
    assert 0 < len(lost) < 60
    assert sorted(campaign.reasons) == lost.tolist()
    assert "mass matrix indefinite" in campaign.reasons[int(lost[0])]
    found = findings(campaign)
    assert found.lost == {"failed": len(lost)}
    assert all(c.broken >= len(lost) for c in found.criteria)
    assert found.criteria[0].worst[: len(lost)] == tuple(lost.tolist())
    assert "counted as worst: " in str(found)


def test_an_oscillation_that_the_five_steps_refuse_has_no_number_in_a_campaign_either():
    case = lawful_case(97, 156)  # its minimum of 0.81 becomes the rigid body's at 2.27 % of damping
    (tank,) = (t.name for t in case.vehicle.tanks)
    d = stage(Linear(), case=case, parameters=(factor("vehicle.mass", 0.02),))
    campaign, draws = run_campaign(d, 6, 4), drawn(d, 4, 0, 6)
    for k, (mass,) in enumerate(draws):
        vehicle = case.vehicle.model_copy(update={"mass": case.vehicle.mass * mass})
        cycle = predict_limit_cycle(case.model_copy(update={"vehicle": vehicle}))
        assert cycle.acceptable is None
        assert "becomes another mode's" in campaign.reasons[k]
        assert campaign.column(f"required_damping.{tank}")[k] == pytest.approx(float(cycle.required.required), rel=1e-6)
    assert np.all(np.isnan(campaign.column(f"slosh.{tank}")) & np.isnan(campaign.column(f"engine.{tank}")))
    assert np.all(campaign.status == Status.FAILED)
    (engine,) = (c for c in findings(campaign).criteria if c.column.name == f"engine.{tank}")
    assert engine.broken == 6


def test_a_run_that_diverges_counts_as_worse_than_every_number():
    d = stage(Nonlinear(duration=900.0, initial_slosh=1.0), case=paper_case(xi(0.001)))
    campaign = run_campaign(d, 3, 4)
    assert np.all(campaign.status == Status.DIVERGED)
    assert np.all(campaign.column("engine_amplitude") == np.inf)
    short = run_campaign(stage(Nonlinear(duration=20.0)), 3, 4)
    assert np.all(short.status == Status.UNSETTLED)
    assert findings(short).criteria[0].broken == 3
    assert np.all(np.isfinite(short.column("engine_peak")))


def test_verdicts_rest_on_what_so_many_cases_can_show():
    rich = stage(Linear(amplitude=1.5), parameters=(factor("vehicle.mass", 0.01),), coverage=0.9, confidence=0.9)
    assert findings(run_campaign(rich, 22, 1)).verdict == "pass"  # 1 - 0.9^22 = 0.902
    few = findings(run_campaign(rich, 21, 1))
    assert few.verdict == "no statement"
    assert "N = 21 cannot support 90 %" in str(few)
    even = findings(run_campaign(stage(Linear(amplitude=1.5), sampling="sobol"), 64, 1))
    assert even.verdict == "no statement"
    assert even.criteria[0].probability is None
    assert even.criteria[0].drivers
    assert all(np.isnan([r.low, r.high]).all() and np.isfinite(r.estimate) for _, r in even.criteria[0].drivers)
    assert " to " not in next(line for line in str(even).splitlines() if "gets worse with" in line)
    assert '"low": null' in even.to_json()
    poor = stage(Linear(amplitude=0.1), coverage=0.9)
    assert findings(run_campaign(poor, 40, 1)).verdict == "fail"


def test_the_verdict_on_a_case_takes_every_criterion_and_no_sure_side_is_no_pass():
    """By plain comparisons, one case after another; a case is marginal only where nothing else is surely broken."""
    d = stage(Linear(amplitude=0.47))
    columns, limit, rows = columns_of(d), d.case.criteria.tvc_amplitude, answered(d, 5, 0, 200)
    assert [c.name for c in columns][-1] == "verdict"
    good = (rows.values[:, 0] >= 1.0) & (rows.values[:, 1] <= 0.0) & (rows.values[:, 4] <= limit)
    assert 20 < np.sum(good) < 180
    assert np.array_equal(rows.values[:, -1], np.where(good, 1.0, -1.0))  # none happens to be marginal
    table = np.array(
        [
            [1.0 + 9e-7, -0.1, 0.04, 0.4, 0.5 * limit],  # 0: within 1e-6 of the disc margin
            [1.0 + 1.1e-6, -0.1, 0.04, 0.4, 0.5 * limit],
            [1.0 - 9e-7, -0.1, 0.04, 0.4, 0.5 * limit],
            [1.0, -0.1, 0.04, 0.4, 1.1 * limit],  # breaks another
            [1.5, 1e-9, 0.04, 0.4, 0.5 * limit],
            [1.5, 1e-8, 0.04, 0.4, 0.5 * limit],
            [1.5, -0.1, 0.04, np.inf, np.inf],
            [np.nan] * 5,
        ]
    )
    expected = [0.0, 1.0, 0.0, -1.0, 0.0, -1.0, -1.0, np.nan]
    np.testing.assert_array_equal(verdicts(columns[:-1], table), expected)
    whole = run_campaign(d, 8, 5)
    found = findings(replace(whole, values=np.column_stack([table, expected])))
    counts = {c.column.name: (c.broken, c.marginal) for c in found.criteria}
    assert counts == {"disc_margin": (4, 3), "growth": (3, 1), "engine.LOX": (3, 0), "verdict": (7, 3)}
    assert "every criterion together: not shown; broken by 7 of 8, 3 of them marginal" in str(found)
    assert json.loads(found.to_json())["criteria"][-1]["marginal"] == 3
    assert set(found.criteria[-1].worst) == {3, 5, 6, 7, 0}


def test_what_is_printed_and_written_holds_every_case(tmp_path):
    campaign = run_campaign(stage(), 30, 2)
    found = findings(campaign)
    plain = json.loads(found.to_json())
    assert plain["done"] == plain["cases"] == 30
    assert plain["criteria"][0]["name"] == "disc_margin"
    dataset = campaign_dataset(campaign)
    assert int(dataset["completed"].sum()) == 30
    assert np.array_equal(dataset["disc_margin"], campaign.column("disc_margin"))
    assert np.array_equal(dataset["drawn.vehicle.mass"], campaign.draws()[:, 0])


def test_axes_of_the_template_follow_the_case_numbers():
    times = paper_case(vehicle={"mass": np.array([1.6e4, 1.5e4, 1.4e4])})
    d = stage(case=times)
    batch = varied(d, drawn(d, 3, 0, 5))
    assert case_shape(batch.case) == (5, 3)
    one = varied(stage(case=paper_case(vehicle={"mass": 1.5e4})), drawn(d, 3, 0, 5))
    assert np.array_equal(batch.case.vehicle.mass[:, 1], one.case.vehicle.mass)
    assert batch.damping_factor.shape == (5, 1, 1)
    found = margins(batch.case, damping=0.05 * batch.damping_factor)
    alone = margins(one.case, damping=0.05 * one.damping_factor)
    assert np.array_equal(found.nichols_disc_margin[:, 1], alone.nichols_disc_margin)
    with pytest.raises(ValueError, match="one case"):
        run_campaign(d, 5, 1)


def test_the_vectored_thrust_keeps_its_part_and_a_pendulum_hangs_in_the_new_acceleration():
    hung = {"station": None, "frequency": None, "hinge_station": 23.06, "pendulum_length": 14.06}
    case = paper_case(vehicle={"vectored_thrust": 6e5})
    tank = SloshMass(name="LOX", slosh_mass=1e3, damping=xi(0.01), **{k: v for k, v in hung.items() if v is not None})
    case = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)})})
    d = Dispersion(name="x", case=case, parameters=(factor("vehicle.thrust", 0.1), factor("vehicle.mass", 0.1)))
    draws = drawn(d, 1, 0, 4)
    v = varied(d, draws).case.vehicle
    np.testing.assert_allclose(v.vectored_thrust, 6e5 * draws[:, 0], rtol=1e-14)
    a = 9e5 * draws[:, 0] / (1.6e4 * draws[:, 1])
    np.testing.assert_allclose(v.tanks[0].frequency, np.sqrt(a / 14.06), rtol=1e-14)


def test_several_tanks_have_columns_of_their_own():
    other = SloshMass(name="LH2", slosh_mass=300.0, station=4.0, frequency=2.5, damping=xi(0.02))
    d = stage(case=paper_case(more=(other,)))
    names = [c.name for c in columns_of(d)]
    assert {"required_damping.LOX", "required_damping.LH2", "engine.LH2"} <= set(names)
    row = rerun(d, 1, 3)
    assert row.status[0] == Status.OK


@pytest.mark.parametrize(("cases", "seed"), [(0, 1), (-5, 1), (10**12, 1), (5, -1), (5, 2**64)])
def test_numbers_that_make_no_campaign_are_refused(cases, seed):
    with pytest.raises(InputError, match="must be"):
        run_campaign(stage(), cases, seed)


def lagged(frequency=20.0, damping=0.7, scale=1.0, **more):
    """The paper's stage with an actuator and a filter of second order whose roots are scaled."""
    w = 15.0 * scale
    notch = Filter(numerator=(1.0, 0.4 * w, w * w), denominator=(1.0, 1.4 * w, w * w))
    actuator = Actuator(frequency=frequency, damping=damping)
    return paper_case(actuator=actuator, filter=(Filter(numerator=(1.0,), denominator=(0.02, 1.0)), notch), **more)


@pytest.mark.parametrize("analysis", [Linear(amplitude=0.8), Nonlinear(duration=60.0, initial_slosh=0.2)])
def test_actuator_and_filters_vary(analysis):
    """Each case is that of a file with these numbers in it; a filter's roots move by one factor, its gain does not."""
    names = ("actuator.frequency", "actuator.damping", "filter.2.frequency", "vehicle.mass")
    d = stage(analysis, case=lagged(), parameters=tuple(factor(name, 0.1) for name in names))
    campaign, draws = run_campaign(d, 5, 3), drawn(d, 3, 0, 5)
    for k, (f, z, scale, mass) in enumerate(draws):
        case = lagged(20.0 * f, 0.7 * z, scale, vehicle={"mass": 1.6e4 * mass})
        if isinstance(analysis, Linear):
            expected = margins(case, damping=0.08)
            assert campaign.column("disc_margin")[k] == pytest.approx(float(expected.nichols_disc_margin), rel=1e-9)
        else:
            step = step_of(d)
            expected = simulate_ensemble(case, 60.0, 0.2, step=step)
            assert campaign.column("slosh_peak.LOX")[k] == pytest.approx(float(expected.slosh_peak[0]), rel=1e-9)
            assert campaign.column("engine_peak")[k] == pytest.approx(float(expected.tvc_peak), rel=1e-9)
    assert np.array_equal(rerun(d, 3, 4).values[0], campaign.values[4], equal_nan=True)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("filter.3.frequency", "names no filter"),
        ("filter.1.damping", "a filter has no input damping"),
        ("actuator.rate_limit", "this actuator has no input rate_limit"),
        ("actuator.x.frequency", "too many parts"),
    ],
)
def test_an_input_of_the_lags_that_is_none_is_refused(name, told):
    with pytest.raises(ValueError, match=told):
        run_campaign(stage(case=lagged(), parameters=(factor(name, 0.1),)), 3, 1)
    with pytest.raises(ValueError, match="the case has no"):
        run_campaign(stage(parameters=(factor("actuator.frequency", 0.1),)), 3, 1)


def test_a_transfer_function_of_an_actuator_is_scaled():
    w = 18.0
    plain = Actuator(frequency=w, damping=0.6)
    same = Actuator(numerator=(w * w,), denominator=(1.0, 1.2 * w, w * w))
    found = [
        run_campaign(stage(case=paper_case(actuator=a), parameters=(factor("actuator.frequency", 0.2),)), 4, 1)
        for a in (plain, same)
    ]
    np.testing.assert_allclose(found[0].column("disc_margin"), found[1].column("disc_margin"), rtol=1e-9)
    assert len(set(found[0].column("disc_margin").tolist())) == 4
