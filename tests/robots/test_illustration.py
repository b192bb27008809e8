"""What an SDF file shows ends up on one frame, and nothing of it is felt."""

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph

from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.robots import DiffDrive
from drake_shared.robots.illustration import register_robot

P3DX = models_directory() / "robots" / "pioneer_p3dx.sdf"


def shown(model) -> dict[str, np.ndarray]:
    scene_graph = SceneGraph()
    _, frame = register_robot(scene_graph, model)
    inspector = scene_graph.model_inspector()
    return {
        inspector.GetName(item): inspector.GetPoseInFrame(item).translation()
        for item in inspector.GetGeometries(frame, Role.kIllustration)
    }


def sdf(path, links: str):
    path.write_text(f"<sdf version='1.9'><model name='m'>{links}</model></sdf>")
    return path


def test_the_p3dx_has_a_body_two_drive_wheels_and_a_caster():
    parts = shown(P3DX)
    names = " ".join(parts)
    assert all(part in names for part in ("body", "left_wheel", "right_wheel", "caster"))
    left = next(place for name, place in parts.items() if name.startswith("left_wheel"))
    right = next(place for name, place in parts.items() if name.startswith("right_wheel"))
    np.testing.assert_allclose(left[1] - right[1], DiffDrive().track, atol=1e-3)
    np.testing.assert_allclose(left[2], DiffDrive().wheel_radius, atol=1e-3)


def test_all_that_is_seen_lies_within_the_footprint():
    for place in shown(P3DX).values():
        assert np.hypot(*place[:2]) < DiffDrive().footprint_radius


def test_links_lie_where_the_model_puts_them(tmp_path):
    model = sdf(
        tmp_path / "m.sdf",
        "<link name='a'><pose>0.1 0.2 0.3 0 0 0</pose><visual name='v'><pose>0.01 0 0 0 0 0</pose>"
        "<geometry><sphere><radius>0.1</radius></sphere></geometry></visual></link>",
    )
    ((name, place),) = shown(model).items()
    assert name.startswith("a_")
    np.testing.assert_allclose(place, [0.11, 0.2, 0.3])


def test_a_model_without_illustration_geometry_is_refused(tmp_path):
    with pytest.raises(InputError, match="<visual>"):
        shown(sdf(tmp_path / "m.sdf", "<link name='a'/>"))


@pytest.mark.parametrize("text", ["", "no xml", "<sdf version='1.9'/>", "<sdf version='1.9'><model/></sdf>"])
def test_what_is_no_model_is_refused_in_one_line_that_names_the_file(tmp_path, text):
    (tmp_path / "m.sdf").write_text(text)
    with pytest.raises(InputError, match=r"m\.sdf must be an SDF file with one model") as caught:
        shown(tmp_path / "m.sdf")
    assert "\n" not in str(caught.value)
