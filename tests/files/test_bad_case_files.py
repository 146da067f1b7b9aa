"""Every bad input of a case file is told with file, line, key, value, rule and cure."""

# ruff: noqa: E501 - one fault is one line of the table
import os
from pathlib import Path

import pytest
from good_case import GOOD, POWER, Refuse
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sloshpy.errors import InputError, Problem
from sloshpy.files import read_case

KG = 'write "16000 kg" or "35274 lbm"'
M = 'write "9 m" or "29.5 ft"'
ONE = 'write 0.048 or "4.8 %"'
PERCENT = 'a damping ratio above 0.3 is not slosh; a percentage is written "4.8 %"'
BESIDE = "put the table beside the case file or below its folder"
TOML = 'write key = value, with texts and quantities in quotation marks, as in mass = "16000 kg"'
VEHICLE = "accelerometer_station, cg, drag, inertia, mass, thrust, vectored_thrust"
MASS, CG, THRUST, GAIN = 'mass = "16000 kg"', 'cg = "6 m"', 'thrust = "900 kN"', "attitude_gain = 0.08"

SHAPE = 'tank.{} = {{ deflection = -0.3, slope = "0.02 1/m" }}\n'
MODE = (
    '[[flexible_mode]]\nname = "x"\nfrequency = "2 Hz"\ndamping = 0.005\ngeneralized_mass = "9000 kg"\n'
    'gimbal = { deflection = 1.0, slope = "-0.08 1/m" }\ngyro = { slope = "0.05 1/m" }\n' + SHAPE.format("LOX")
)
ENGINE = '[engine]\nfirst_moment = "1500 kg*m"\ninertia = "2500 kg*m^2"\n'
FORMS = "give one form: an actuator has frequency and damping, or numerator and denominator"
ONE_FAULT: dict[str, tuple[str, str, tuple[int, str, str, str, str]]] = {
    # units
    "bare number": (MASS, "mass = 16000", (4, "vehicle mass", "16000", "has no unit", 'write it with its unit, as in "16000 kg" (kg)')),
    "text without unit": (MASS, 'mass = "16000"', (4, "vehicle mass", '"16000"', "has no unit", KG)),
    "wrong dimension": (MASS, 'mass = "3 m"', (4, "vehicle mass", '"3 m"', "is a length, must be a mass", KG)),
    "unknown unit": (MASS, 'mass = "1 kq"', (4, "vehicle mass", '"1 kq"', 'has the unknown unit "kq"', KG)),
    "pounds for a force": (THRUST, 'thrust = "2 lb"', (7, "vehicle thrust", '"2 lb"', "is a mass, must be a force", "did you mean lbf? lb and lbm are masses")),
    "ambiguous frequency": ('"0.5 Hz"', '"0.5 1/s"', (20, 'tank "LH2" frequency', '"0.5 1/s"', "does not say whether it is cyclic or angular", 'write "2 rad/s" or "0.32 Hz"')),
    "hertz for a gain": ('"0.14 s"', '"1 Hz"', (28, "autopilot rate_gain", '"1 Hz"', "is a frequency, must be a time", 'write "0.14 s" or "20 ms"')),
    "decimal comma": (CG, "cg = '1,5 m'", (6, "vehicle cg", "'1,5 m'", "is not one plain number", "write a decimal point and no thousands separator")),
    "Fortran exponent": (CG, 'cg = "1.0D+03 m"', (6, "vehicle cg", '"1.0D+03 m"', "has a Fortran exponent", "write e in place of D, as in 1.0e3")),
    "bare decibels": ('"6 dB"', "2.0", (38, "criteria gain_margin", "2.0", "has no unit", 'write it with its unit, as in "2.0 dB" (dB)')),
    # ranges
    "nan": (CG, "cg = nan", (6, "vehicle cg", "nan", "must be finite", M)),
    "inf": (CG, "cg = -inf", (6, "vehicle cg", "-inf", "must be finite", M)),
    "beyond every float": (CG, 'cg = "1e999 m"', (6, "vehicle cg", '"1e999 m"', "must be finite", M)),
    "integer beyond every float": (GAIN, f"attitude_gain = 1{'0' * 400}", (27, "autopilot attitude_gain", f"1{'0' * 76}...", "must be finite", ONE)),
    "negative mass": (MASS, 'mass = "-16000 kg"', (4, "vehicle mass", '"-16000 kg"', "must be > 0 kg", "drop the sign")),
    "zero thrust": (THRUST, 'thrust = "0 N"', (7, "vehicle thrust", '"0 N"', "must be > 0 N", "give a value in this range")),
    "zero frequency": ('"2 rad/s"', '"0 Hz"', (13, 'tank "LOX" frequency', '"0 Hz"', "must be > 0 rad/s", "give a value in this range")),
    "percent for fraction": ("ratio = 0.01", "ratio = 4.8", (24, 'tank "LH2" damping ratio', "4.8", "must be >= 0 and <= 0.3", PERCENT)),
    "long delay": (GAIN, f'{GAIN}\ndelay = "6 s"', (28, "autopilot delay", '"6 s"', "must be >= 0 s and <= 5 s", "give a value in this range")),
    "threshold of 0 dB": ('"6 dB"', '"0 dB"', (38, "criteria gain_margin", '"0 dB"', "must be > 0 dB", "give a value in this range")),
    # relations
    "mass matrix": ('"1000 kg"', '"13793 kg"', (11, 'tank "LOX" slosh_mass', '"13793 kg"', "makes the mass matrix indefinite: m/M + m l^2/I must be < 1 (is 1.009)", "check that mass and inertia include the slosh mass")),
    "lever beyond every vehicle": ('"9 m"', '"1e200 m"', (12, 'tank "LOX" station', '"1e200 m"', "must be below 1e+15 m", M)),
    "drag": (THRUST, f'{THRUST}\ndrag = "1 MN"', (8, "vehicle drag", '"1 MN"', "must be < thrust", "the axial acceleration that drives slosh must be > 0")),
    "both gains 0": (f'{GAIN}\nrate_gain = "0.14 s"', 'attitude_gain = 0\nrate_gain = "0 s"', (27, "autopilot attitude_gain", "0", "and rate_gain are both 0: the loop is open", "give at least one gain")),
    "thresholds": ('gain_margin = "6 dB"', "limit_cycle_disc_margin = 0.9", (38, "criteria limit_cycle_disc_margin", "0.9", "must be >= disc_margin", "widen the band, as the paper does with 1.1 for 1.0")),
    "improper filter": ("numerator = [1.0]", "numerator = [1, 2, 3]", (31, "autopilot filter 1 numerator", "[1, 2, 3]", "has more coefficients than the denominator", "a filter must be proper")),
    "leading zero": ("numerator = [1.0]", "numerator = [0, 1.0]", (31, "autopilot filter 1 numerator", "[0, 1.0]", "must not start with 0", "drop the leading zeros")),
    # kinds of values
    "bool for number": (GAIN, "attitude_gain = true", (27, "autopilot attitude_gain", "true", "is not a number", ONE)),
    "list for number": (GAIN, "attitude_gain = [0.08]", (27, "autopilot attitude_gain", "[0.08]", "is not a number", ONE)),
    "date for number": (GAIN, "attitude_gain = 1979-05-27", (27, "autopilot attitude_gain", "1979-05-27", "is not a number", ONE)),
    "text in a list": ("  0.02,", '  "x",', (33, "autopilot filter 1 denominator 1", '"x"', "must start with a number", ONE)),
    "number for list": ("numerator = [1.0]", "numerator = 1.0", (31, "autopilot filter 1 numerator", "1.0", "must be a list", "write it in [ ]")),
    "empty list": ("numerator = [1.0]", "numerator = []", (31, "autopilot filter 1 numerator", "[]", "must not be empty", "give at least one")),
    "number for table": (GAIN, f"{GAIN}\nactuator = 3", (28, "autopilot actuator", "3", "must be a table", "its keys are damping, deadband, deflection_limit, denominator, frequency, numerator, rate_limit")),
    "number for damping": (POWER, "0.01", (14, 'tank "LOX" damping', "0.01", "must be a table", 'write { law = "constant", ratio = 0.01 } or another law')),
    "number for name": ('name = "LOX"', "name = 3", (10, "tank 1 name", "3", "must be a text", "write it in quotation marks")),
    "name with a line end": ('name = "LOX"', 'name = "L\\nX"', (10, "tank 1 name", '"L\\nX"', "must be 1 to 64 letters, digits, spaces, _ . or -, the first a letter or digit", "rename it")),
    "name with markup": ('name = "A stage"', 'name = "<script>"', (1, "name", '"<script>"', "must be 1 to 100 letters, digits, spaces, _ . or -, the first a letter or digit", "rename it")),
    "table for array of tables": ("[[autopilot.filter]]", "[autopilot.filter]", (30, "autopilot filter", "", "must be an array of tables", "write its header as [[autopilot.filter]]")),
    # keys
    "unknown key": (THRUST, f'{THRUST}\ndrg = "1 N"', (8, "vehicle drg", '"1 N"', "is an unknown key", 'did you mean "drag"?')),
    "unknown key, none near": ("ratio = 0.01", "ratio = 0.01\nq = 3", (25, 'tank "LH2" damping q', "3", "is an unknown key", "the names here are law, ratio")),
    "unknown table": ("[criteria]", "[criterai]", (37, "criterai", "", "is an unknown key", 'did you mean "criteria"?')),
    "key that is no word": (CG, f'{CG}\n"a b" = 1', (7, 'vehicle "a b"', "1", "is an unknown key", f"the names here are {VEHICLE}")),
    "tanks in the vehicle": (CG, f"{CG}\ntanks = []", (7, "vehicle tanks", "[]", "is an unknown key", "write it under its own header [[tank]]")),
    "a source": ("[criteria]", '[source]\nfile = "x"\n[criteria]', (37, "source", "", "is an unknown key", "the names here are aerodynamics, autopilot, criteria, engine, flexible_mode, name, tank, vehicle")),
    "missing key": (f"{THRUST}\n", "", (3, "vehicle thrust", "", "is missing", f"add {THRUST}")),
    "missing key of a tank": ('name = "LOX"\n', "", (9, "tank 1 name", "", "is missing", 'add name = "..."')),
    "missing key of an inline table": (GAIN, f'{GAIN}\nactuator = {{ frequency = "6 Hz" }}', (28, "autopilot actuator damping", "", "is missing", "add damping = 0.7")),
    "missing name": ('name = "A stage"\n', "", (1, "name", "", "is missing", 'add name = "..." at the top')),
    "missing damping": (f"damping = {POWER}\n", "", (9, 'tank "LOX" damping', "", "is missing", 'add damping = { law = "constant", ratio = 0.01 } or another law')),
    "duplicate tank": ('"LH2"', '"lox"', (17, 'tank "lox" name', '"lox"', "is the name of the tank in line 10 too", "rename one")),
    "duplicate key": (CG, f'{CG}\ncg = "7 m"', (7, "vehicle cg", '"7 m"', "is given twice, first in line 6", "keep one of the two")),
    "duplicate key in an inline table": ("exponent = 1 ", "exponent = 1, law = 3 ", (14, "tank 1 damping law", "3", "is given twice, first in line 14", "keep one of the two")),
    "duplicate table": ("[criteria]", "[vehicle]", (37, "vehicle", "", "is given twice, first in line 3", "keep one of the two")),
    # not modelled yet
    "mode that leaves a tank out": ("[criteria]", f"{MODE}[criteria]", (44, 'flexible_mode "x" tank', "", 'has no shape at tank "LH2"', "give tank.LH2 its deflection and slope")),
    "mode at a tank that is not": ("[criteria]", f"{MODE}{SHAPE.format('LH2')}{SHAPE.format('RP1')}[criteria]", (46, 'flexible_mode "x" tank RP1', '{ deflection = -0.3, slope = "0.02 1/m" }', "is no tank of the case", "one of LOX, LH2")),
    "mode with a wrong unit": ("[criteria]", f"{MODE}{SHAPE.format('LH2')}".replace("-0.08 1/m", "-0.08 m") + "[criteria]", (42, 'flexible_mode "x" gimbal slope', '"-0.08 m"', "is a length, must be a ratio per length", 'write "0.1 1/m" or "10 %/m"')),
    "actuator in both forms": (GAIN, f'{GAIN}\nactuator = {{ frequency = "6 Hz", damping = 0.7, numerator = [1], denominator = [1, 1] }}', (28, "autopilot actuator numerator", "[1]", "stands beside frequency and damping", FORMS)),
    "actuator with half of both": (GAIN, f'{GAIN}\nactuator = {{ frequency = "6 Hz", damping = 0.7, denominator = [1, 1] }}', (28, "autopilot actuator denominator", "[1, 1]", "stands beside frequency and damping", FORMS)),
    "actuator without a frequency": (GAIN, f"{GAIN}\nactuator = {{ damping = 0.7 }}", (28, "autopilot actuator damping", "0.7", "stands without frequency", FORMS[15:])),
    "actuator of nothing": (GAIN, f"{GAIN}\nactuator = {{}}", (28, "autopilot actuator frequency", "", "is missing", 'add frequency = "6 Hz" and damping, or a transfer function')),
    "actuator without a denominator": (GAIN, f"{GAIN}\nactuator = {{ numerator = [1] }}", (28, "autopilot actuator numerator", "[1]", "stands without denominator", "add denominator = [...]")),
    "improper actuator": (GAIN, f"{GAIN}\nactuator = {{ numerator = [1, 1], denominator = [1] }}", (28, "autopilot actuator numerator", "[1, 1]", "has more coefficients than the denominator", "an actuator must be proper")),
    "actuator led by zero": (GAIN, f"{GAIN}\nactuator = {{ numerator = [1], denominator = [0, 1, 1] }}", (28, "autopilot actuator denominator", "[0, 1, 1]", "must not start with 0", "drop the leading zeros")),
    "unstable actuator": (GAIN, f"{GAIN}\nactuator = {{ numerator = [9], denominator = [1, -1, 9] }}", (28, "autopilot actuator denominator", "[1, -1, 9]", "has a pole at 0.5 +- 2.958j rad/s", "an actuator is stable: every pole lies left of the axis")),
    "neutral actuator": (GAIN, f"{GAIN}\nactuator = {{ numerator = [9], denominator = [1, 0, 9] }}", (28, "autopilot actuator denominator", "[1, 0, 9]", "has a pole at 0 +- 3j rad/s", "an actuator is stable: every pole lies left of the axis")),
    "integrating actuator": (GAIN, f"{GAIN}\nactuator = {{ numerator = [9], denominator = [1, 9, 0] }}", (28, "autopilot actuator denominator", "[1, 9, 0]", "has a pole at 0 rad/s", "an actuator is stable: every pole lies left of the axis")),
    "rate in cycles": (GAIN, f'{GAIN}\nactuator = {{ frequency = "6 Hz", damping = 0.7, rate_limit = "0.2 Hz" }}', (28, "autopilot actuator rate_limit", '"0.2 Hz"', "is a frequency, must be an angular rate", 'write "15 deg/s" or "0.26 rad/s"')),
    "rate in no angle": (GAIN, f'{GAIN}\nactuator = {{ frequency = "6 Hz", damping = 0.7, rate_limit = "0.2 1/s" }}', (28, "autopilot actuator rate_limit", '"0.2 1/s"', "does not say of which angle", 'write "15 deg/s" or "0.26 rad/s"')),
    "limit of a transfer function": (GAIN, f'{GAIN}\nactuator = {{ numerator = [9], denominator = [1, 9], rate_limit = "1 deg/s" }}', (28, "autopilot actuator rate_limit", '"1 deg/s"', "needs the actuator's frequency and damping: a transfer function has no rate to limit", "give frequency and damping in place of numerator and denominator")),
    "engine on a first-order actuator": ("[autopilot]", f"{ENGINE}[autopilot]\nactuator = {{ numerator = [9], denominator = [1, 9] }}", (30, "autopilot actuator numerator", "[9]", "is of less than two orders below the denominator: a step of the command would jerk the engine without end, and it has inertia", "give a denominator of two orders more")),
    "engine without an actuator": ("[criteria]", f"{ENGINE}[criteria]", (37, "engine", "", "has inertia, but nothing accelerates it: the autopilot has no actuator", "give autopilot.actuator its frequency and damping")),
    "mode named as a tank": ("[criteria]", f"{MODE}{SHAPE.format('LH2')}".replace('name = "x"', 'name = "lox"') + "[criteria]", (38, 'flexible_mode "lox" name', '"lox"', "is the name of a tank or of another mode too", "rename one")),
    "engine heavier than the vehicle": ("[criteria]", '[engine]\nfirst_moment = "15000 kg*m"\ninertia = "2500 kg*m^2"\n[criteria]', (38, "engine first_moment", '"15000 kg*m"', "squared over the inertia is more than the vehicle's mass", "both are about the gimbal: inertia is at least first_moment^2 / mass of the engines")),
    "air without a speed": ("[criteria]", '[aerodynamics]\nnormal_force_slope = "2e5 N"\ncenter_of_pressure = "12 m"\n[criteria]', (37, "aerodynamics speed", "", "is missing", 'add speed = "400 m/s"')),
    "tank file": ('station = "9 m"', 'station = "9 m"\ntank_file = "lox.toml"', (13, 'tank "LOX" tank_file', '"lox.toml"', "stands beside slosh_mass", "give the slosh mass either here or by the tank file")),
    # laws of damping
    "unknown law": ('"constant"', '"constnat"', (23, 'tank "LH2" damping law', '"constnat"', "is not a law of damping", 'did you mean "constant"?')),
    "no law": ('law = "constant"\n', "", (22, 'tank "LH2" damping law', "", "is missing", 'name the law of damping: "constant", "power", "table" or "sum"')),
    "bare slope": ('"0.1 1/m"', "0.1", (14, 'tank "LOX" damping slope', "0.1", "has no unit", 'write "0.1 1/m"')),
    "bare end of a law": ("exponent = 1 ", "largest_amplitude = 0.3 ", (14, 'tank "LOX" damping largest_amplitude', "0.3", "has no unit", 'write it with its unit, as in "0.3 m" (m)')),
    "end of a law at rest": ("exponent = 1 ", 'largest_amplitude = "0 m" ', (14, 'tank "LOX" damping largest_amplitude', '"0 m"', "must be > 0 m and <= 1000 m", 'give a value in this range')),
    "no slope": ('slope = "0.1 1/m", ', "", (14, 'tank "LOX" damping slope', "", "is missing", 'add slope = "0.1 1/m"')),
    "slope of another exponent": ("exponent = 1 ", "exponent = 0.5 ", (14, 'tank "LOX" damping slope', '"0.1 1/m"', "is a ratio per length, must be of dimension 1 / [length] ** 0.5", 'write "0.1 1/m^0.5"')),
    "exponent nan": ("exponent = 1 ", "exponent = nan ", (14, 'tank "LOX" damping exponent', "nan", "must be finite", ONE)),
    "amplitude not increasing": (POWER, '{ law = "table", amplitude = ["0 m", "0.2 m",\n"0.1 m"], ratio = [0.1, 0.1, 0.2] }', (15, 'tank "LOX" damping amplitude 3', '"0.1 m"', "must increase, but 0.1 m follows 0.2 m", "sort the rows")),
    "amplitude negative": (POWER, '{ law = "table", amplitude = ["-1 m", "0.2 m"], ratio = [0.1, 0.1] }', (14, 'tank "LOX" damping amplitude 1', '"-1 m"', "must be >= 0 m and <= 1000 m", "drop the sign")),
    "amplitude bare": (POWER, '{ law = "table", amplitude = ["0 m", 1], ratio = [0.1, 0.1] }', (14, 'tank "LOX" damping amplitude 2', "1", "has no unit", 'write it with its unit, as in "1 m" (m)')),
    "one row": (POWER, '{ law = "table", amplitude = ["0 m"], ratio = [0.1] }', (14, 'tank "LOX" damping amplitude', '["0 m"]', "has 1 row", 'give at least two, or use law = "constant"')),
    "lengths differ": (POWER, '{ law = "table", amplitude = ["0 m", "1 m"], ratio = [0.1] }', (14, 'tank "LOX" damping ratio', "[0.1]", "has 1 values for 2 amplitudes", "give one ratio for each amplitude")),
    "amplitude no list": (POWER, '{ law = "table", amplitude = "0 m", ratio = [0.1] }', (14, 'tank "LOX" damping amplitude', '"0 m"', "must be a list", 'write ["9 m", ...]')),
    "part of a sum": (POWER, '{ law = "sum", of = [\n{ law = "constant", ratio = 0.01 },\n{ law = "constant", ratio = 0.5 } ] }', (16, 'tank "LOX" damping of 2 ratio', "0.5", "must be >= 0 and <= 0.3", PERCENT)),
    "sum of a sum": (POWER, '{ law = "sum", of = [ { law = "sum", of = [] } ] }', (14, 'tank "LOX" damping of 1 law', '"sum"', "is not a law of damping", "the names here are constant, power, table")),
    "empty sum": (POWER, '{ law = "sum", of = [] }', (14, 'tank "LOX" damping of', "[]", "must not be empty", "give at least one")),
    # files of tables
    "file and table": (POWER, '{ law = "table", file = "a.csv", ratio = [0.1] }', (14, 'tank "LOX" damping file', '"a.csv"', "stands beside amplitude or ratio", "give the table either here or in the file")),
    "file no text": (POWER, '{ law = "table", file = 3 }', (14, 'tank "LOX" damping file', "3", "must be a text", 'write file = "decay.csv"')),
    "file missing": (POWER, '{ law = "table", file = "no.csv" }', (14, 'tank "LOX" damping file', '"no.csv"', "does not exist", "check its name and its folder")),
    "file above": (POWER, '{ law = "table", file = "../a.csv" }', (14, 'tank "LOX" damping file', '"../a.csv"', "leads out of the case file's folder", BESIDE)),
    "file in a sum above": (POWER, '{ law = "sum", of = [ { law = "table", file = "a/../../b.csv" } ] }', (14, 'tank "LOX" damping of 1 file', '"a/../../b.csv"', "leads out of the case file's folder", BESIDE)),
    "file absolute": (POWER, '{ law = "table", file = "/etc/passwd" }', (14, 'tank "LOX" damping file', '"/etc/passwd"', "is an absolute path", BESIDE)),
    "file at home": (POWER, '{ law = "table", file = "~/a.csv" }', (14, 'tank "LOX" damping file', '"~/a.csv"', "leads out of the case file's folder", BESIDE)),
    "file on a network": (POWER, '{ law = "table", file = "http://a/b.csv" }', (14, 'tank "LOX" damping file', '"http://a/b.csv"', "is an address on a network", BESIDE)),
    "file on a drive": (POWER, '{ law = "table", file = "C:a.csv" }', (14, 'tank "LOX" damping file', '"C:a.csv"', "is not a plain relative path", BESIDE)),
    "file with a NUL": (POWER, '{ law = "table", file = "a\\u0000.csv" }', (14, 'tank "LOX" damping file', '"a\\u0000.csv"', "is not a plain relative path", BESIDE)),
    # TOML
    "no quotation marks": (CG, "cg = 6 m", (6, "TOML syntax", "cg = 6 m", "expected newline or end of document after a statement", TOML)),
    "octal": (CG, "cg = 010", (6, "TOML syntax", "cg = 010", "expected newline or end of document after a statement", TOML)),
    "open text": (CG, 'cg = "6 m', (6, "TOML syntax", 'cg = "6 m', "illegal character '\\n'", TOML)),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), ONE_FAULT.values(), ids=ONE_FAULT.keys())
def test_one_fault_is_told_with_line_key_value_rule_and_cure(
    refused: Refuse, old: str, new: str, expected: tuple[int, str, str, str, str]
) -> None:
    line, key, value, rule, cure = expected
    assert refused((old, new)) == [Problem(file="case.toml", line=line, key=key, value=value, rule=rule, cure=cure)]


def test_several_problems_are_all_told_in_file_order(refused: Refuse) -> None:
    problems = refused(
        ('gain_margin = "6 dB"', "gain_margin = 6"),
        ("ratio = 0.01", 'ratio = "x"\nbogus = 1'),
        ('"0.5 Hz"', '"0.5 kg"'),
        (MASS, "mass = -1"),
        ("[autopilot]", '[engine]\nfirst_moment = 3\ninertia = "1 kg*m^2"\n[autopilot]'),
        (f"{THRUST}\n", ""),
    )
    assert [(p.line, p.key) for p in problems] == [
        (3, "vehicle thrust"),
        (4, "vehicle mass"),
        (19, 'tank "LH2" frequency'),
        (23, 'tank "LH2" damping ratio'),
        (24, 'tank "LH2" damping bogus'),
        (27, "engine first_moment"),
        (41, "criteria gain_margin"),
    ]


def test_lines_are_right_where_tables_stand_apart_and_keys_are_dotted_or_quoted(refused: Refuse) -> None:
    problems = refused(
        text="""\
name = "x"
vehicle.mass = "1"  # a comment = "with" [brackets]
vehicle."inertia" = '''
9e5 m'''
[[tank]]
name = "a"
damping.law = "constant"
damping.ratio = 4
[autopilot]
attitude_gain = "["
[[tank]]
name = "b"
damping = { law = "table", amplitude = [ "0 m", # ]
  "1 kg" ], ratio = [ 0, 0.1 ] }
"""
    )
    told = [(p.line, p.key, p.value) for p in problems if p.rule != "is missing"]
    assert told == [
        (2, "vehicle mass", '"1"'),
        (3, "vehicle inertia", "''' 9e5 m'''"),
        (8, 'tank "a" damping ratio', "4"),
        (10, "autopilot attitude_gain", '"["'),
        (14, 'tank "b" damping amplitude 2', '"1 kg"'),
    ]
    missing = {(p.line, p.key) for p in problems if p.rule == "is missing"}
    assert {(5, 'tank "a" frequency'), (11, 'tank "b" frequency'), (9, "autopilot rate_gain")} <= missing
    assert (2, "vehicle thrust") in missing


def test_a_file_without_a_tank_has_nothing_to_assess(refused: Refuse) -> None:
    text = GOOD[: GOOD.index("[[tank]]")] + GOOD[GOOD.index("[autopilot]") :]
    cure = "add a tank under the header [[tank]]"
    expected = Problem(file="case.toml", line=1, key="tank", value="", rule="no slosh mass to assess", cure=cure)
    assert refused(text=text) == [expected]
    assert refused(text=f"tank = []\n{text}") == [
        Problem(file="case.toml", line=1, key="tank", value="[]", rule="no slosh mass to assess", cure=cure)
    ]


def test_a_file_without_a_vehicle_says_so_once(refused: Refuse) -> None:
    text = GOOD[: GOOD.index("[vehicle]")] + GOOD[GOOD.index("[[tank]]") :]
    assert refused(text=text) == [
        Problem(
            file="case.toml", line=1, key="vehicle", value="", rule="is missing", cure=f"add [vehicle] with {VEHICLE}"
        )
    ]


def test_a_fault_of_a_tank_is_told_beside_a_vehicle_that_is_no_table(refused: Refuse) -> None:
    problems = refused(text="vehicle = 3\ntank = [1]\nautopilot = 3\nname = 3\n")
    assert [(p.line, p.key, p.value, p.rule) for p in problems] == [
        (1, "vehicle", "3", "must be a table"),
        (2, "tank 1", "1", "must be a table"),
        (3, "autopilot", "3", "must be a table"),
        (4, "name", "3", "must be a text"),
    ]


def test_a_tank_under_a_plain_header_is_told_how_to_write_it(refused: Refuse) -> None:
    text = GOOD[: GOOD.index('[[tank]]\nname = "LH2"')] + GOOD[GOOD.index("[autopilot]") :]
    problems = refused(("[[tank]]", "[tank]"), text=text)
    assert [(p.line, p.key, p.rule, p.cure) for p in problems] == [
        (9, "tank", "must be an array of tables", "write its header as [[tank]]")
    ]


def test_faults_of_a_damping_table_are_told_in_the_table(refused: Refuse, tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text("amplitude [m], ratio [%]\n0, 1\n0.2, x\n0.1, 2\n")
    problems = refused((MASS, "mass = 1"), (POWER, '{ law = "table", file = "d.csv" }'), ("ratio = 0.01", "ratio = 2"))
    assert [(p.file, p.line, p.key, p.value) for p in problems] == [
        ("case.toml", 4, "vehicle mass", "1"),
        ("d.csv", 3, "column ratio", "x"),
        ("case.toml", 24, 'tank "LH2" damping ratio', "2"),
    ]


def test_a_link_that_leaves_the_folder_is_not_followed(refused: Refuse, tmp_path: Path) -> None:
    outside = tmp_path.parent / f"{tmp_path.name}-outside.csv"
    outside.write_text("amplitude [m], ratio [%]\n0, 1\n1, 2\n")
    (tmp_path / "d.csv").symlink_to(outside)
    [problem] = refused((POWER, '{ law = "table", file = "d.csv" }'))
    assert (problem.line, problem.rule) == (14, "is a link that leads out of the case file's folder")


def _whole_file(path: str) -> Problem:
    with pytest.raises(InputError) as caught:
        read_case(path)
    [problem] = caught.value.problems
    assert problem.file == path
    assert problem.cure
    return problem


def test_a_file_that_is_no_case_file_is_one_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("empty.toml").write_bytes(b"")
    Path("blank.toml").write_bytes(b"\xef\xbb\xbf \r\n")
    Path("latin.toml").write_bytes(b'name = "a"\nnote = "\xe9"\n')
    Path("utf16.toml").write_bytes(GOOD.encode("utf-16"))
    Path("deep.toml").write_text("a = " + "[" * 100_000)
    Path("large.toml").write_bytes(b"#" * 10_000_001)
    os.mkfifo("pipe")
    assert _whole_file("missing.toml").rule == "does not exist"
    assert _whole_file("folder").rule == "is a directory"
    assert _whole_file("empty.toml").rule == "is empty"
    assert _whole_file("blank.toml").rule == "is empty"
    assert (_whole_file("latin.toml").line, _whole_file("latin.toml").rule) == (2, "is not UTF-8 text at byte 19")
    assert _whole_file("utf16.toml").rule == "is not UTF-8 text at byte 0"
    assert _whole_file("deep.toml").rule == "is nested too deeply"
    assert _whole_file("large.toml").rule == "has 10000001 bytes, more than 10000000"
    assert _whole_file("pipe").rule == "is not a regular file"
    assert _whole_file("a\x00b").rule.startswith("cannot be read")


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_any_bytes_are_a_case_or_an_input_error(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "any.toml"
    path.write_bytes(raw)
    with pytest.raises(InputError):
        read_case(path)


_PIECES = ["nan", "-1", "0", "1e308", '"1e308 m"', "[]", "{}", "[[]]", "[{}]", "true", '""', '"1e-320 kg"', "[tank]"]
_PIECES += ["[[tank]]", "tank", "law", '"sum"', '"table"', "of", "file", "=", "\n", '"', ".", "source", '"1e150 m"']


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 12), st.sampled_from(_PIECES)), min_size=1, max_size=4)
)
def test_a_spoilt_case_is_a_case_or_an_input_error_with_lines(
    tmp_path: Path, edits: list[tuple[int, int, str]]
) -> None:
    text = GOOD
    for start, length, piece in edits:
        text = text[:start] + piece + text[start + length :]
    path = tmp_path / "spoilt.toml"
    path.write_text(text)
    problems: tuple[Problem, ...] = ()
    try:
        read_case(path)
    except InputError as error:
        problems = error.problems or (Problem(key="", value="", rule=""),)  # an error without problems fails below
    assert all(p.key and p.rule and p.cure and p.file and p.line for p in problems)
