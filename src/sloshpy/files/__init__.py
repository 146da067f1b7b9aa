"""Files: cases, flights, dispersions, tables, time histories, the shipped examples, schemas of case and tank files."""

from sloshpy.files.case_file import read_case
from sloshpy.files.dispersion_file import read_dispersion
from sloshpy.files.examples import (
    example_dispersion_names,
    example_flight_names,
    example_names,
    example_record_names,
    example_tank_names,
    write_example,
)
from sloshpy.files.exchange import from_control, response_to_control, to_control
from sloshpy.files.fill_history import read_fill_table, write_fill_history
from sloshpy.files.flight_file import read_flight
from sloshpy.files.requirement_table import write_requirement
from sloshpy.files.schema import case_schema, tank_schema
from sloshpy.files.tables import read_damping_table
from sloshpy.files.tank_file import read_tank
from sloshpy.files.time_history import read_time_history
from sloshpy.files.write import damping_line, write_case

__all__ = [
    "case_schema",
    "damping_line",
    "example_dispersion_names",
    "example_flight_names",
    "example_names",
    "example_record_names",
    "example_tank_names",
    "from_control",
    "read_case",
    "read_damping_table",
    "read_dispersion",
    "read_fill_table",
    "read_flight",
    "read_tank",
    "read_time_history",
    "response_to_control",
    "tank_schema",
    "to_control",
    "write_case",
    "write_example",
    "write_fill_history",
    "write_requirement",
]
