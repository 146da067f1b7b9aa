"""A dispersion file: TOML text in, a Dispersion out, or everything that is wrong with it, each with its line."""

import hashlib
import os
import re
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from sloshpy.case import Case
from sloshpy.dispersion.dispersion import Correlation, Dispersion, Linear, Nonlinear, Parameter, moments_of
from sloshpy.dispersion.distribution import Distribution, Triangular, TruncatedNormal, Uniform
from sloshpy.dispersion.flown_faults import flown_fault
from sloshpy.dispersion.varied import RUN, find_input, nominal, stands_in
from sloshpy.errors import InputError, Problem
from sloshpy.files.case_file import read_case
from sloshpy.files.flight_file import read_flight
from sloshpy.files.places import Path, Places, find_places
from sloshpy.files.text_file import beside, read_text
from sloshpy.files.toml_text import Found, in_file_order, once, parse_toml
from sloshpy.files.wording import nearest, value_at
from sloshpy.flight import Phase
from sloshpy.units import Quantity, UnitError, example, parse
from sloshpy.vehicle.slosh_mass import NAME

_TOP = ("name", "case", "flight", "sampling", "coverage", "confidence", "linear", "nonlinear", "vary", "correlation")
_KINDS: dict[str, tuple[type[Uniform] | type[Triangular] | type[TruncatedNormal], tuple[str, ...]]] = {
    "uniform": (Uniform, ("low", "high")),
    "triangular": (Triangular, ("low", "mode", "high")),
    "truncated normal": (TruncatedNormal, ("mean", "sigma", "low", "high")),
}
_FACTOR = Quantity("1", meaning="factor", least=0.0)
_PART = Quantity("1", meaning="part of the cases", above=0.0, below=1.0)
_RUN = {
    "duration": Quantity("s", above=0.0, most=1e5),
    "initial_slosh": Quantity("m", above=0.0, most=100.0),
    "gain": Quantity("dB", above=1e-5, below=1e5),
    "delay": Quantity("s", least=0.0, most=5.0),
    **{name: quantity for name, quantity in RUN.items() if name.startswith("gust_")},
}
_READ = {"amplitude": Quantity("m", least=0.0, most=1e3)}


def read_dispersion(path: str | os.PathLike[str]) -> Dispersion:
    """Read a dispersion file and the case file that it names.

    Args:
        path: a TOML file; quantities are texts with their unit, factors bare numbers or percent.

    Raises:
        InputError: with every fault of the file, in file order, or of the case file.
    """
    raw, text = read_text(path, "dispersion file")
    file = os.fspath(path)
    places = find_places(text)
    page = _Page(parse_toml(text, file, places), places)
    page.known_keys((), page.document, _TOP)
    name = page.text(("name",), FilePath(file).stem)
    if name is not None and re.match(NAME.replace("{0,63}", "{0,99}"), name) is None:
        page.refuse(("name",), "must be 1 to 100 letters, digits, spaces, _ . or -", "rename it")
    sampling = page.choice(("sampling",), ("random", "sobol"), "random")
    coverage = page.quantity(("coverage",), _PART, 0.99865)
    confidence = page.quantity(("confidence",), _PART, 0.9)
    analysis = _analysis(page)
    folder = FilePath(file).parent
    phases: tuple[Phase, ...] = ()
    case: Case | None = None
    if "flight" in page.document:
        phases, digest = _flight(page, folder)
        case = phases[0].cases[0] if phases else None
    else:
        case, digest = _case(page, folder)
    flight = moments_of(phases)
    cases = tuple(moment.case for moment in flight) or ((case,) if case is not None else ())
    parameters = _parameters(page, cases, analysis)
    _check_gust(page, cases, analysis, parameters)
    correlations = _correlations(page, parameters)
    found = once(page.found)
    if found or case is None or name is None or coverage is None or confidence is None:
        raise InputError(*in_file_order(found, file, places))
    read = Dispersion(
        name=name,
        case=case,
        parameters=tuple(parameters.values()),
        correlations=tuple(correlations),
        sampling="random" if sampling == "random" else "sobol",
        analysis=analysis,
        coverage=coverage,
        confidence=confidence,
        digest=f"{hashlib.sha256(raw).hexdigest()} {digest}",
        flight=flight,
        phases=() if isinstance(analysis, Linear) else phases,
    )
    fault = flown_fault(read)
    if fault is not None:
        page.refuse(("nonlinear", fault[0]) if fault[0] in page.document["nonlinear"] else ("nonlinear",), *fault[1:])
        raise InputError(*in_file_order(page.found, file, places))
    return read


class _Page:
    """A document being read; what is wrong with it is gathered."""

    def __init__(self, document: dict[str, Any], places: Places) -> None:
        self.document, self.places = document, places
        self.found: Found = []

    def refuse(self, path: Path, rule: str, cure: str) -> None:
        words = " ".join(str(step) if isinstance(step, str) else str(step + 1) for step in path)
        self.found.append((path, Problem(key=words, value=value_at(path, self.places), rule=rule, cure=cure)))

    def known_keys(self, path: Path, table: dict[str, Any], keys: tuple[str, ...]) -> None:
        for key in table:
            if key not in keys:
                self.refuse((*path, key), "is an unknown key", nearest(key, list(keys)))

    def at(self, path: Path) -> Any:
        node: Any = self.document
        for step in path:
            node = node.get(step) if isinstance(node, dict) else node[int(step)]
        return node

    def text(self, path: Path, default: str | None) -> str | None:
        value = self.at(path)
        if value is None and default is not None:
            return default
        if isinstance(value, str):
            return value
        if value is None:
            self.refuse(path, "is missing", f'add {path[-1]} = "..."')
        else:
            self.refuse(path, "must be a text", "write it in quotation marks")
        return None

    def choice(self, path: Path, choices: tuple[str, ...], default: str | None) -> str | None:
        value = self.text(path, default)
        if value is None or value in choices:
            return value
        self.refuse(path, f"must be one of {', '.join(choices)}", nearest(value, list(choices)))
        return None

    def flag(self, path: Path, default: bool = False) -> bool:
        value = self.at(path)
        if value is None:
            return default
        if not isinstance(value, bool):
            self.refuse(path, "must be true or false", f"write {path[-1]} = true")
        return value is True

    def quantity(self, path: Path, quantity: Quantity, default: float | None = None) -> float | None:
        """Return a quantity in SI within its range, None where there is none or it is refused."""
        value = self.at(path)
        if value is None:
            if default is None:
                self.refuse(path, "is missing", f"add {path[-1]} = {example(quantity.unit).split(' or ')[0]}")
            return default
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            self.refuse(path, "is not a number", f"write {example(quantity.unit)}")
            return None
        if not isinstance(value, str) and quantity.unit != "1":
            self.refuse(path, "has no unit", f"write {example(quantity.unit)}")
            return None
        try:
            read = parse(value if isinstance(value, str) else repr(value), quantity.unit)
        except UnitError as error:
            self.refuse(path, error.rule, error.cure)
            return None
        if not within(quantity, read):
            self.refuse(path, quantity.rule, "give a value in this range")
            return None
        return read

    def tables(self, key: str) -> list[tuple[Path, dict[str, Any]]]:
        value = self.document.get(key, [])
        if isinstance(value, list) and all(isinstance(one, dict) for one in value):
            return [((key, k), one) for k, one in enumerate(value)]
        self.refuse((key,), "must be an array of tables", f"write its header as [[{key}]]")
        return []


def within(quantity: Quantity, value: float) -> bool:
    """Return whether a value is in a quantity's range."""
    ends = (
        (quantity.above, 1, False),
        (quantity.least, 1, True),
        (quantity.below, -1, False),
        (quantity.most, -1, True),
    )
    return all(end is None or sign * (value - end) > 0.0 or (closed and value == end) for end, sign, closed in ends)


def _analysis(page: _Page) -> Linear | Nonlinear:
    given = [key for key in ("linear", "nonlinear") if key in page.document]
    for key in given:
        if not isinstance(page.document[key], dict):
            page.refuse((key,), "must be a table", f"write its header as [{key}]")
            return Linear()
    if len(given) == 2:
        page.refuse(("nonlinear",), "stands beside linear", "ask one question a file")
    if "nonlinear" in given:
        page.known_keys(("nonlinear",), page.document["nonlinear"], tuple(_RUN))
        default = Nonlinear()
        read = {k: page.quantity(("nonlinear", k), q, getattr(default, k)) for k, q in _RUN.items()}
        return Nonlinear(**{k: v for k, v in read.items() if v is not None})
    if "linear" in given:
        page.known_keys(("linear",), page.document["linear"], (*_READ, "required_damping"))
        required = page.flag(("linear", "required_damping"), True)
        amplitude = None
        if "amplitude" in page.document["linear"]:
            amplitude = page.quantity(("linear", "amplitude"), _READ["amplitude"])
        return Linear(amplitude=amplitude, required=required)
    return Linear()


def _flight(page: _Page, folder: FilePath) -> tuple[tuple[Phase, ...], str]:
    """Return the phases of the flight that is named and the hash of its file; its faults are told as its own."""
    path: Path = ("flight",)
    if "case" in page.document:
        page.refuse(("case",), "stands beside flight", "leave it out")
    run = page.document.get("nonlinear")
    if isinstance(run, dict) and "duration" in run:
        page.refuse(("nonlinear", "duration"), "is asked of one case; a flight lasts from start to end", "leave it out")
    name = page.text(path, None)
    try:
        if name is None:
            return (), ""
        file = beside(name, folder)
        found, hashed = read_flight(file), hashlib.sha256(FilePath(file).read_bytes()).hexdigest()
    except InputError as error:
        if error.problems[0].line is None:
            page.refuse(path, error.problems[0].rule, error.problems[0].cure)
        page.found += [(path, problem) for problem in error.problems if problem.line is not None]
        return (), ""
    except ValueError as error:
        page.refuse(path, str(error).replace("case file", "dispersion file"), "put the flight file beside it")
        return (), ""
    if any(case.criteria != found.phases[0].cases[0].criteria for phase in found for case in phase.cases):
        page.refuse(path, "has phases with different criteria", "give every phase's case the same [criteria]")
    return found.phases, hashed


def _case(page: _Page, folder: FilePath) -> tuple[Case | None, str]:
    """Return the case that is named and the hash of its files; its faults are told as its own."""
    name = page.text(("case",), None)
    if name is None:
        return None, ""
    try:
        file = beside(name, folder)
    except ValueError as error:
        page.refuse(("case",), str(error).replace("case file", "dispersion file"), "put the case file beside it")
        return None, ""
    try:
        case = read_case(file)
    except InputError as error:
        if error.problems[0].line is None:
            page.refuse(("case",), error.problems[0].rule, error.problems[0].cure)
        page.found += [(("case",), problem) for problem in error.problems if problem.line is not None]
        return None, ""
    source = case.source
    assert source is not None
    hashes = [source.sha256, *(v for k, v in sorted(source.given.items()) if k.endswith(" sha256"))]
    return case, " ".join(hashes)


def _parameters(page: _Page, cases: tuple[Case, ...], analysis: Linear | Nonlinear) -> dict[str, Parameter]:
    """Return the parameters by name; without a case their inputs cannot be looked up."""
    parameters: dict[str, Parameter] = {}
    tables = page.tables("vary")
    if not tables and not page.document.get("vary"):
        page.refuse(("vary",), "is missing: nothing varies", 'add [[vary]] with input = "vehicle.mass"')
    taken: dict[str, str] = {}
    for path, table in tables:
        parameter = _parameter(page, path, table, cases, analysis)
        if parameter is None:
            continue
        fields = list(dict.fromkeys(field for case in cases for field in _fields(case, parameter.input)))
        twice = [taken[field] for field in fields if field in taken]
        if twice:
            page.refuse((*path, "input"), f"varies what {twice[0]} varies", "keep one of the two")
        taken |= dict.fromkeys(fields, parameter.input)
        parameters[parameter.input] = parameter
    return parameters


def _check_gust(
    page: _Page, cases: tuple[Case, ...], analysis: Linear | Nonlinear, parameters: dict[str, Parameter]
) -> None:
    """Refuse a gust of a case that the wind does not move, and what varies of a gust that there is none of."""
    if not cases or not isinstance(analysis, Nonlinear):
        return
    speed, path = parameters.get("run.gust_speed"), ("nonlinear", "gust_speed")
    blowing = analysis.gust_speed != 0.0 or (speed is not None and not speed.factor)
    if blowing and all(case.vehicle.aerodynamics is None for case in cases):
        page.refuse(path, "acts by the aerodynamics, and the case has none", "add [aerodynamics] to the case")
    elif not blowing and any(name.startswith("run.gust_") for name in parameters):
        page.refuse(path, "is missing: there is no gust that could vary", 'write gust_speed = "10 m/s"')


def _fields(case: Case, text: str) -> list[str]:
    """Return every number of a case that an input means."""
    if not stands_in(case, text):
        return []
    found = find_input(case, text)
    return [f"{found.noun}.{one}.{found.field}" for one in (found.names if found.names is not None else ("",))]


def _parameter(
    page: _Page, path: Path, table: dict[str, Any], cases: tuple[Case, ...], analysis: Linear | Nonlinear
) -> Parameter | None:
    before = len(page.found)
    name = page.text((*path, "input"), None)
    kind = page.choice((*path, "distribution"), tuple(_KINDS), None)
    form = page.choice((*path, "as"), ("factor", "absolute"), "factor")
    systematic = page.flag((*path, "systematic"))
    keys = _KINDS[kind][1] if kind is not None else tuple({k for _, ks in _KINDS.values() for k in ks})
    page.known_keys(path, table, ("input", "distribution", "as", "systematic", *keys))
    if name is None or kind is None or form is None or not cases:
        return None
    with_it = [case for case in cases if stands_in(case, name)]
    try:
        found = find_input(with_it[0] if with_it else cases[0], name)
    except ValueError as error:
        rule, _, cure = str(error).partition("\n")
        page.refuse((*path, "input"), rule, cure)
        return None
    run = analysis if isinstance(analysis, Nonlinear) else None
    if found.noun == "run" and run is None:
        page.refuse((*path, "input"), "is asked of a simulation, and the file asks for margins", "write [nonlinear]")
        return None
    quantity = found.quantity
    if form == "absolute" and (quantity is None or (quantity.unit == "dB" and kind == "truncated normal")):
        page.refuse((*path, "as"), "is no form for this input", 'write as = "factor"')
        return None
    unit = Quantity(quantity.unit) if form == "absolute" and quantity is not None else Quantity("1")
    numbers = {key: page.quantity((*path, key), unit) for key in keys}
    if len(page.found) > before:
        return None
    try:
        distribution: Distribution = _KINDS[kind][0](**{k: v for k, v in numbers.items() if v is not None})
    except ValueError as error:
        key, _, rule = str(error).partition(": ")
        page.refuse((*path, key), rule, "give bounds that hold the distribution")
        return None
    values = [value for case in with_it for value in nominal(case, find_input(case, name), run)]
    if form == "absolute" and len({float(v) for v in values if v is not None}) > 1 and len(cases) > 1:
        page.refuse((*path, "as"), "is no form for what changes along the flight", 'write as = "factor"')
        return None
    for key in ("low", "high"):
        end = getattr(distribution, key)
        _in_range(page, (*path, key), quantity, [end if form == "absolute" else end * v for v in values], end, form)
    if len(page.found) > before:
        return None
    return Parameter(input=name, distribution=distribution, factor=form == "factor", systematic=systematic)


def _in_range(page: _Page, path: Path, quantity: Quantity | None, values: list[Any], end: float, form: str) -> None:
    """Refuse a bound at which the input is no physical one: nothing is clipped later."""
    if form == "factor" and not (end > 0.0 or (quantity is None and end == 0.0)):
        page.refuse(path, "must be > 0: a factor changes no sign", 'write low = 0.9, or as = "absolute"')
    elif quantity is not None and not all(within(quantity, float(v)) for v in values):
        worst = next(float(v) for v in values if not within(quantity, float(v)))
        page.refuse(path, f"makes the input {worst:.6g}, which {quantity.rule}", "draw the bounds closer")


def _correlations(page: _Page, parameters: dict[str, Parameter]) -> list[Correlation]:
    correlations: list[Correlation] = []
    taken: set[str] = set()
    named = {str(table.get("input")) for _, table in page.tables("vary")}
    for path, table in page.tables("correlation"):
        page.known_keys(path, table, ("inputs", "matrix"))
        inputs, matrix = table.get("inputs"), table.get("matrix")
        if not isinstance(inputs, list) or len(inputs) < 2 or not all(isinstance(x, str) for x in inputs):
            page.refuse((*path, "inputs"), "must be a list of two or more inputs", 'write ["vehicle.mass", ...]')
            continue
        if any(x in named and x not in parameters for x in inputs):
            continue  # refused already where it stands
        unknown = [x for x in inputs if x not in parameters]
        if unknown or len(set(inputs)) < len(inputs) or taken & set(inputs):
            rule = f"holds {unknown[0]}, which does not vary" if unknown else "holds an input twice or one taken before"
            page.refuse((*path, "inputs"), rule, "name inputs of [[vary]], each once")
            continue
        taken |= set(inputs)
        if len({parameters[x].systematic for x in inputs}) > 1:
            page.refuse((*path, "inputs"), "joins systematic inputs with others", "correlate inputs of one kind")
            continue
        rows = matrix if isinstance(matrix, list) else []
        if (
            not rows
            or not all(isinstance(r, list) and len(r) == len(rows) for r in rows)
            or not all(isinstance(x, int | float) and not isinstance(x, bool) for r in rows for x in r)
        ):
            page.refuse((*path, "matrix"), "must be a square of numbers", "write [[1, 0.5], [0.5, 1]]")
            continue
        try:
            correlations.append(Correlation(inputs=tuple(inputs), matrix=np.array(rows, dtype=float)))
        except ValueError as error:
            page.refuse((*path, "matrix"), str(error), "make it symmetric, 1 on the diagonal, and consistent")
    return correlations
