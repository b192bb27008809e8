"""The contract of operators: what is refused, and why."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drake_shared.common.errors import InputError, RunError
from drake_shared.robots import DiffDrive
from drake_shared.simulation import (
    AddSharedControl,
    MakeSharedControlDiagram,
    Simulation,
    TrialSettings,
)
from drake_shared.systems.operators import check_operator, make_operator

ROBOT = DiffDrive()


class Operator(LeafSystem):
    """Gives a constant command as state, with ports to be varied."""

    def __init__(
        self, *, size: int = 2, inputs=(), feedthrough: bool = False, log_columns=None, command: float = 1.0
    ):
        super().__init__()
        for name, width in inputs:
            self.DeclareVectorInputPort(name, width)
        if feedthrough:
            self.DeclareVectorInputPort("pose", 3)
            self.DeclareVectorOutputPort("human_command", size, lambda context, output: None)
        else:
            self.DeclareStateOutputPort("human_command", self.DeclareDiscreteState(np.full(size, command)))
        if log_columns is not None:
            self.log_columns = log_columns


def test_an_operator_with_the_ports_of_the_contract_passes():
    inputs = (("pose", 3), ("human_weight", 1), ("shared_command", 2), ("noise", 7), ("chance", 2))
    check_operator(Operator(inputs=inputs), ROBOT)


@pytest.mark.parametrize(
    ("operator", "field"),
    [
        (Operator(size=3), "human_command"),
        (Operator(feedthrough=True), "human_command"),
        (Operator(inputs=[("pose", 2)]), "pose"),
        (Operator(inputs=[("human_weight", 2)]), "human_weight"),
        (Operator(log_columns={"human_command": ("one",)}), "human_command"),
        (Operator(log_columns={"nothing": ("one",)}), "nothing"),
        (Operator(log_columns=["one"]), "log_columns"),
        (Operator(command=np.nan), "human_command"),
        (LeafSystem(), "human_command"),
        ("primary", ""),
    ],
)
def test_an_operator_that_breaks_the_contract_is_refused(operator, field):
    with pytest.raises(InputError) as caught:
        check_operator(operator, ROBOT)
    assert caught.value.source.startswith("operator")
    assert caught.value.field == field


def test_an_unknown_name_is_refused(scenario):
    with pytest.raises(InputError) as caught:
        make_operator("nobody", scenario=scenario)
    assert caught.value.source == "operator"


def test_an_input_that_nothing_connects_is_reported(scenario):
    with pytest.raises(InputError) as caught:
        MakeSharedControlDiagram(scenario, operator=Operator(inputs=[("lidar", 5)]))
    assert caught.value.field == "lidar"


def test_a_column_of_the_log_has_one_source(scenario):
    operator = Operator(log_columns={"human_command": ("x", "two")})
    with pytest.raises(InputError) as caught:
        MakeSharedControlDiagram(scenario, operator=operator)
    assert caught.value.field == "x"


class LateFailure(LeafSystem):
    """An operator that fails after 1 s."""

    def __init__(self):
        super().__init__()
        self.DeclareStateOutputPort("human_command", self.DeclareDiscreteState(2))
        self.DeclarePeriodicDiscreteUpdateEvent(0.05, 0.0, self._update)

    def _update(self, context, state):
        state.set_value([1.0 / (context.get_time() < 1.0), 1.0])


def test_an_exception_in_an_operator_names_it_and_the_time(scenario):
    simulation = Simulation(scenario, operator=LateFailure())
    with pytest.raises(RunError, match=r"operator \(LateFailure\).*ZeroDivisionError.*t = 1\.0"):
        simulation.run(TrialSettings())


def test_a_builder_of_ones_own_may_connect_further_inputs(scenario):
    builder = DiagramBuilder()
    parts = AddSharedControl(builder, scenario=scenario, operator=Operator(inputs=[("lidar", 3)]))
    builder.Connect(parts.plant.GetOutputPort("pose"), parts.operator.GetInputPort("lidar"))
    builder.Build()
