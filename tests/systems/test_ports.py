"""Which systems fit into a diagram, by their ports."""

import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import Diagram, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.systems.ports import check_ports


class Part(LeafSystem):
    """One port of each kind."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("command", 2)
        self.DeclareAbstractInputPort("intention", Value(0))
        self.DeclareVectorOutputPort("pose", 3, lambda _context, _output: None)


def test_a_system_with_the_ports_fits():
    check_ports(Part(), "part", inputs={"command": 2, "intention": None}, outputs={"pose": 3})
    check_ports(Part(), "part")


@pytest.mark.parametrize(
    ("kind", "ports", "named"),
    [
        ("inputs", {"command": 3}, "command"),
        ("inputs", {"command": 2, "confidence": 1}, "confidence"),
        ("inputs", {"command": None}, "command"),
        ("inputs", {"intention": 1}, "intention"),
        ("outputs", {"pose": 2}, "pose"),
        ("outputs", {"command": 2}, "command"),
    ],
)
def test_a_port_that_is_missing_or_of_another_kind_or_size_is_named(kind, ports, named):
    with pytest.raises(InputError) as caught:
        check_ports(Part(), "part", **{kind: ports})
    assert (caught.value.source, caught.value.field) == ("part Part", named)


@pytest.mark.parametrize("other", [Diagram, object])
def test_what_is_no_leaf_system_is_refused(other):
    with pytest.raises(InputError) as caught:
        check_ports(other(), "part")
    assert caught.value.source == f"part {other.__name__}"
