"""A tank given as a pendulum is the spring-mass of the same motion: derived once more, and the forms kept apart."""

import numpy as np
import pytest
import sympy as sp
from pydantic import ValidationError

from cases import PAPER_TANK, PAPER_VEHICLE, paper_case, random_case, xi
from sloshpy.batch import for_each
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.errors import InputError
from sloshpy.files import case_schema, read_case, write_case
from sloshpy.report.inputs import input_rows
from sloshpy.stability import danger_zone, margins, required_damping_map
from sloshpy.vehicle import SloshMass, Vehicle

SPRING = 'station = "9 m"\nfrequency = "2 rad/s"\n'
PENDULUM = 'hinge_station = "23.0625 m"\npendulum_length = "14.0625 m"\n'
TEXT = f"""name = "x"
[vehicle]
mass = "16000 kg"
inertia = "9e5 kg*m^2"
cg = "6 m"
thrust = "900 kN"
[[tank]]
name = "LOX"
slosh_mass = "1000 kg"
{SPRING}damping = {{ law = "constant", ratio = 0.02 }}
[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"
"""


def hung(case):
    """The case with every tank as a pendulum; the lengths that the frequencies mean."""
    v = case.vehicle
    tanks = []
    for t in v.tanks:
        length = v.acceleration / t.frequency**2
        tanks.append(
            SloshMass(
                name=t.name,
                slosh_mass=t.slosh_mass,
                hinge_station=t.station + length,
                pendulum_length=length,
                damping=t.damping,
            )
        )
    given = {k: getattr(v, k) for k in type(v).model_fields}
    return case.model_copy(update={"vehicle": Vehicle(**given | {"tanks": tuple(tanks)})})


def lagrange(count):
    """M q'' + C q' + K q = b beta for q = [Z, phi, theta_j] of true pendulums, by Lagrange in an inertial frame.

    The bob hangs from a hinge on the rigid axis; the body without the bobs has what is left of mass, c.g. and inertia.
    """
    t = sp.Symbol("t")
    M, I, Xcg, F, R, D = sp.symbols("M I Xcg F R D")
    parts = [sp.symbols(f"m{j} X{j} L{j} c{j}") for j in range(count)]
    u, Z, phi = (sp.Function(n)(t) for n in ("u", "Z", "phi"))
    theta = [sp.Function(f"theta{j}")(t) for j in range(count)]
    beta = sp.Symbol("beta")

    def at(X):
        """A point of the axis, forward of the c.g. of the whole at rest."""
        return sp.Matrix([u + (X - Xcg) * sp.cos(phi), Z + (X - Xcg) * sp.sin(phi)])

    def energy(m, r):
        v = r.diff(t)
        return m * v.dot(v) / 2

    # the dry body: the moments of the whole at rest less those of the bobs in place
    M0 = M - sum(m for m, *_ in parts)
    X0 = (M * Xcg - sum(m * (X - L) for m, X, L, _ in parts)) / M0
    I0 = I - M0 * (X0 - Xcg) ** 2 - sum(m * (X - L - Xcg) ** 2 for m, X, L, _ in parts)
    T = energy(M0, at(X0)) + I0 * phi.diff(t) ** 2 / 2
    Rayleigh = 0
    for (m, X, L, c), th in zip(parts, theta, strict=True):
        # the string points aft of the hinge; theta > 0 swings the bob toward +Z of the body
        T += energy(m, at(X) + L * sp.Matrix([-sp.cos(phi - th), -sp.sin(phi - th)]))
        Rayleigh += c * th.diff(t) ** 2 / 2
    forces = [
        ((F - R) * sp.Matrix([sp.cos(phi), sp.sin(phi)]), at(0)),
        (R * sp.Matrix([sp.cos(phi + beta), sp.sin(phi + beta)]), at(0)),
        (-D * sp.Matrix([sp.cos(phi), sp.sin(phi)]), at(Xcg)),
    ]
    q = [Z, phi, *theta]
    symbols = [[sp.Symbol(f"{mark}{k}") for k in range(len(q))] for mark in "qva"]
    rows = []
    for x in q:
        row = T.diff(x.diff(t)).diff(t) - T.diff(x) + Rayleigh.diff(x.diff(t)) if Rayleigh != 0 else 0
        rows.append(row - sum(f.dot(r.diff(x)) for f, r in forces))
    a = (F - D) / M
    swap = [(u.diff(t, 2), a), (u.diff(t), sp.Symbol("w")), (u, 0)]
    for order, names in ((2, symbols[2]), (1, symbols[1]), (0, symbols[0])):
        swap += [(x.diff(t, order) if order else x, n) for x, n in zip(q, names, strict=True)]
    rows = [row.subs(swap) for row in rows]
    rest = dict.fromkeys([*symbols[0], *symbols[1], *symbols[2], beta], 0)
    assert all(sp.simplify(row.subs(rest)) == 0 for row in rows)  # straight flight is a motion

    def linear(by):
        return sp.Matrix([[row.diff(x).subs(rest) for x in by] for row in rows])

    matrices = [linear(symbols[2]), linear(symbols[1]), linear(symbols[0]), -linear([beta])]
    numbers = [M, I, Xcg, F, R, D, *(x for part in parts for x in part)]
    assert not any(sp.Symbol("w") in sp.simplify(m).free_symbols for m in matrices)
    return sp.lambdify(numbers, matrices, "numpy")


@pytest.mark.parametrize("count", [1, 2])
def test_a_true_pendulum_has_the_same_loop_and_its_bob_moves_by_length_times_angle(count):
    derived = lagrange(count)
    rng = np.random.default_rng(310 + count)
    for _ in range(20):
        case, damping = random_case(rng, tanks=count, delay=False, actuator=False, filters=False)
        case = hung(case)
        v = case.vehicle
        numbers = [v.mass, v.inertia, v.cg, v.thrust, v.vectored_thrust, v.drag]
        for t, x in zip(v.tanks, damping, strict=True):
            m, L = t.slosh_mass, t.pendulum_length
            # 2 xi w m z'^2 as a Rayleigh function of theta', with w = sqrt(a / L) of a pendulum
            numbers += [m, t.hinge_station, L, 2 * x * np.sqrt(v.acceleration / L) * m * L**2]
        M, C, K, b = (np.asarray(x, dtype=float) for x in derived(*numbers))
        s = 1j * np.geomspace(0.05, 20, 30) * v.tanks[0].frequency
        q = np.linalg.solve(s[:, None, None] ** 2 * M + s[:, None, None] * C + K, b)[..., 0]
        L = -case.autopilot.gain * (case.autopilot.attitude_gain + s * case.autopilot.rate_gain) * q[:, 1]
        z = q[:, 2:] * np.array([t.pendulum_length for t in v.tanks])
        found = frequency_response(open_loop(case, damping), s.imag)
        # 1e-15 of the greatest: beside a zero both routes cancel
        assert np.all(np.abs(found.loop - L) < 1e-12 * np.abs(L) + 1e-15 * np.abs(L).max())
        assert np.all(np.abs(found.slosh - z) < 1e-12 * np.abs(z) + 1e-15 * np.abs(z).max())


def test_the_pendulum_of_the_papers_tank_is_where_the_traps_say():
    """At this thrust the hinge is 900 kN / 16 t / (2 rad/s)^2 = 14.0625 m ahead of the mass."""
    mass = SloshMass(name="LOX", slosh_mass=1e3, hinge_station=23.0625, pendulum_length=14.0625, damping=xi(0.02))
    assert mass.station == 9.0
    assert np.isnan(mass.frequency)
    there = Vehicle(**PAPER_VEHICLE, tanks=(mass,)).tanks[0]
    assert (there.station, there.frequency) == (9.0, 2.0)


def test_the_frequency_follows_the_acceleration_along_leading_axes_and_in_copies():
    mass = np.array([1.6e4, 1.2e4, 2.0e4])
    tank = SloshMass(name="LOX", slosh_mass=1e3, hinge_station=23.0625, pendulum_length=14.0625, damping=xi(0.02))
    v = Vehicle(**PAPER_VEHICLE | {"mass": mass}, tanks=(tank,), drag=1e5)
    np.testing.assert_allclose(v.tanks[0].frequency, np.sqrt(8e5 / mass / 14.0625), rtol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        v.tanks[0].frequency[0] = 1.0
    lighter = v.model_copy(update={"mass": 1.5e4, "drag": 0.0})
    assert lighter.tanks[0].frequency == np.sqrt(60.0 / 14.0625)
    batch = paper_case(xi(0.02)).model_copy(update={"vehicle": v})
    together, alone = margins(batch), for_each(margins, batch)
    for k, one in enumerate(alone):
        assert together.nichols_disc_margin[k] == pytest.approx(float(one.nichols_disc_margin), rel=1e-6)
    lengths = SloshMass(
        name="LOX", slosh_mass=1e3, hinge_station=23.0, pendulum_length=np.array([10.0, 14.0]), damping=xi(0.02)
    )
    assert lengths.station.tolist() == [13.0, 9.0]
    v = Vehicle(**PAPER_VEHICLE, tanks=(lengths,))
    np.testing.assert_allclose(v.tanks[0].frequency, np.sqrt(56.25 / np.array([10.0, 14.0])), rtol=1e-15)


def test_a_pendulum_changed_in_one_place_only_is_refused():
    tank = SloshMass(name="LOX", slosh_mass=1e3, hinge_station=23.0, pendulum_length=14.0, damping=xi(0.02))
    with pytest.raises(ValidationError, match=r"station is not hinge|is not hinge_station - pendulum_length"):
        Vehicle(**PAPER_VEHICLE, tanks=(tank.model_copy(update={"station": 8.0}),))
    moved = tank.model_copy(update={"hinge_station": 24.0, "station": 10.0})
    assert Vehicle(**PAPER_VEHICLE, tanks=(moved,)).tanks[0].station == 10.0


@pytest.mark.parametrize(
    ("given", "field", "rule"),
    [
        (
            {"station": 9.0, "frequency": 2.0, "hinge_station": 23.0, "pendulum_length": 14.0},
            "station",
            "stands beside",
        ),
        ({"station": 9.0, "hinge_station": 23.0, "pendulum_length": 14.0}, "station", "stands beside"),
        ({"frequency": 2.0, "hinge_station": 23.0, "pendulum_length": 14.0}, "frequency", "stands beside"),
        ({"hinge_station": 23.0}, "pendulum_length", "hinge_station stands without pendulum_length"),
        ({"pendulum_length": 14.0}, "pendulum_length", "pendulum_length stands without hinge_station"),
        ({"hinge_station": 23.0, "frequency": 2.0}, "pendulum_length", "hinge_station stands without"),
        ({"station": 9.0, "frequency": 2.0, "pendulum_length": 14.0}, "pendulum_length", "stands without"),
        ({"station": 9.0}, "frequency", "is missing"),
        ({"frequency": 2.0}, "station", "is missing"),
        ({"hinge_station": 23.0, "pendulum_length": 0.0}, "pendulum_length", "must be > 0 m"),
        ({"station": float("nan"), "frequency": 2.0}, "station", "must be finite"),
    ],
)
def test_both_forms_or_half_of_one_are_one_error(given, field, rule):
    with pytest.raises(ValidationError) as caught:
        SloshMass(name="LOX", slosh_mass=1e3, damping=xi(0.02), **given)
    [error] = caught.value.errors()
    assert error["loc"] == (field,)
    assert rule in error["msg"]


@pytest.mark.parametrize(
    ("tank", "line", "key", "rule"),
    [
        (SPRING + PENDULUM, 10, "station", "stands beside hinge_station and pendulum_length"),
        ('hinge_station = "23 m"\n', 7, "pendulum_length", "hinge_station stands without pendulum_length"),
        ('station = "9 m"\n', 7, "frequency", "is missing"),
        (
            PENDULUM.replace("14.0625 m", "14 rad"),
            11,
            "pendulum_length",
            "is a plain number or an angle, must be a length",
        ),
    ],
)
def test_a_file_with_both_forms_or_half_of_one_is_told_once_with_its_line(tmp_path, tank, line, key, rule):
    path = tmp_path / "case.toml"
    path.write_text(TEXT.replace(SPRING, tank))
    with pytest.raises(InputError) as caught:
        read_case(path)
    [problem] = caught.value.problems
    assert (problem.line, problem.key, problem.rule) == (line, f'tank "LOX" {key}', rule)
    assert problem.cure


def test_a_file_with_a_pendulum_reads_writes_and_reports_what_was_given(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(TEXT.replace(SPRING, PENDULUM))
    case = read_case(path)
    plain = {"station": 9.0, "frequency": 2.0, **{k: PAPER_TANK[k] for k in ("name", "slosh_mass")}}
    assert {k: getattr(case.vehicle.tanks[0], k) for k in plain} == plain
    back = read_case(write_case(case, tmp_path / "back.toml"))
    assert back.vehicle == case.vehicle
    text = (tmp_path / "back.toml").read_text()
    assert "pendulum_length" in text
    assert "\nstation" not in text
    assert "\nfrequency" not in text
    rows = {row.key: row.given for row in input_rows(case)}
    assert rows["tank.LOX.hinge_station"] == "23.0625 m"
    assert rows["tank.LOX.pendulum_length"] == "14.0625 m"
    forms = case_schema()["properties"]["tank"]["items"]["oneOf"]
    assert [set(form["required"]) for form in forms] == [
        {"slosh_mass", "station", "frequency"},
        {"slosh_mass", "hinge_station", "pendulum_length"},
        {"tank_file"},
    ]


def test_the_map_of_required_damping_moves_a_pendulum_as_a_whole():
    spring = paper_case(xi(0.02))
    pendulum = hung(spring)
    stations = np.array([4.0, 7.0, 9.0, 12.0])
    a, b = (required_damping_map(case, station=stations) for case in (spring, pendulum))
    np.testing.assert_allclose(a.required, b.required, rtol=1e-9)
    assert danger_zone(spring).aft == pytest.approx(danger_zone(pendulum).aft, rel=1e-14)
