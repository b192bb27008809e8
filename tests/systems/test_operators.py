"""The contract of operators: what is refused, and why."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.simulation import AddSharedControl, MakeSharedControlDiagram
from drake_shared.systems.operators import check_operator, make_operator

ROBOT = DiffDrive()


class Operator(LeafSystem):
    """Gives a constant command as state, with ports to be varied."""

    def __init__(self, *, size: int = 2, inputs=(), feedthrough: bool = False, log_columns=None):
        super().__init__()
        for name, width in inputs:
            self.DeclareVectorInputPort(name, width)
        if feedthrough:
            self.DeclareVectorInputPort("pose", 3)
            self.DeclareVectorOutputPort("human_command", size, lambda context, output: None)
        else:
            self.DeclareStateOutputPort("human_command", self.DeclareDiscreteState(np.ones(size)))
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
        (LeafSystem(), "human_command"),
        ("primary", ""),
    ],
)
def test_an_operator_that_breaks_the_contract_is_refused(operator, field):
    with pytest.raises(InputError) as caught:
        check_operator(operator, ROBOT)
    assert caught.value.source.startswith("operator")
    assert caught.value.field == field


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError) as caught:
        make_operator("nobody", scenario=None)
    assert caught.value.source == "operator"


def test_an_input_that_nothing_connects_is_reported(scenario):
    with pytest.raises(InputError) as caught:
        MakeSharedControlDiagram(scenario, operator=Operator(inputs=[("lidar", 5)]))
    assert caught.value.field == "lidar"


def test_a_builder_of_ones_own_may_connect_further_inputs(scenario):
    builder = DiagramBuilder()
    parts = AddSharedControl(builder, scenario=scenario, operator=Operator(inputs=[("lidar", 3)]))
    builder.Connect(parts.plant.GetOutputPort("pose"), parts.operator.GetInputPort("lidar"))
    builder.Build()
