"""The paper's upper stage and what the figures are drawn from, once for all tests."""

import pytest

from sloshpy.case import Case
from sloshpy.files import read_case
from sloshpy.limit_cycle import LimitCycle, predict_limit_cycle
from sloshpy.stability import DampingSweep, damping_sweep


@pytest.fixture(scope="session")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    from sloshpy.files import write_example

    return read_case(write_example("upper_stage", tmp_path_factory.mktemp("case")))


@pytest.fixture(scope="session")
def cycle(case: Case) -> LimitCycle:
    return predict_limit_cycle(case)


@pytest.fixture(scope="session")
def sweep(case: Case, cycle: LimitCycle) -> DampingSweep:
    return damping_sweep(case, required=cycle.required)
