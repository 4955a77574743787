"""The Blender add-on, with a stand-in for Blender that takes arrays as `foreach_set` does: of the right length only."""

import importlib.util
import sys
import tomllib
import types
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.types import UP_AXES
from tests.golden import GOLDEN

ADDON = Path(__file__).resolve().parents[2] / "engines" / "blender"
COLORED = GOLDEN / "colored" / "vertices.reel"


class Collection(list):
    """Elements with values that are set all at once."""

    def __init__(self, widths: dict[str, int]) -> None:
        super().__init__()
        self.widths, self.values, self.count = widths, dict[str, np.ndarray](), 0

    def add(self, count: int) -> None:
        self.count += count

    def foreach_set(self, name: str, values: np.ndarray) -> None:
        assert len(values) == self.widths[name] * self.count and values.ndim == 1
        self.values[name] = np.array(values)


class MeshData:
    """A mesh of Blender's, as far as add-ons fill it."""

    def __init__(self) -> None:
        self.materials = list[Any]()
        self.clear_geometry()

    def clear_geometry(self) -> None:
        self.vertices, self.loops = Collection({"co": 3}), Collection({"vertex_index": 1})
        self.polygons, self.color_attributes = Collection({"loop_start": 1}), Attributes(self)

    def update(self, calc_edges: bool) -> None:
        assert calc_edges and self.loops.values["vertex_index"].max(initial=-1) < self.vertices.count
        assert self.loops.count == 3 * self.polygons.count


class Attributes(list):
    """Colour attributes of a mesh."""

    def __init__(self, mesh: MeshData) -> None:
        super().__init__()
        self.mesh = mesh

    def new(self, name: str, type: str, domain: str) -> Any:
        assert (type, domain) == ("BYTE_COLOR", "POINT")
        data = Collection({"color_srgb": 4})
        data.add(self.mesh.vertices.count)
        self.append(SimpleNamespace(name=name, data=data))
        return self[-1]


class ObjectData(dict):
    """An object of Blender's: custom properties, and a mesh."""

    type = "MESH"

    def __init__(self, name: str, data: MeshData) -> None:
        super().__init__()
        self.name, self.data = name, data


class Nodes(dict):
    def new(self, _type: str) -> Any:
        return SimpleNamespace(layer_name="", outputs={"Color": "out"})


@pytest.fixture
def blender(monkeypatch):
    """The add-on, a scene at 24 frames a second, and what Blender would keep of it."""
    bpy = types.ModuleType("bpy")
    handlers = types.ModuleType("bpy.app.handlers")
    handlers.persistent, handlers.frame_change_pre = (lambda function: function), []
    menus, classes = [], []
    tree = SimpleNamespace(nodes=Nodes({"Principled BSDF": SimpleNamespace(inputs={"Base Color": "in"})}))
    tree.links = SimpleNamespace(new=lambda a, b: (a, b))
    bpy.app = SimpleNamespace(handlers=handlers)
    bpy.data = SimpleNamespace(
        meshes=SimpleNamespace(new=lambda _name: MeshData()),
        objects=SimpleNamespace(new=ObjectData),
        materials=SimpleNamespace(new=lambda name: SimpleNamespace(name=name, node_tree=tree)),
    )
    bpy.path = SimpleNamespace(abspath=str, display_name_from_filepath=lambda path: Path(path).stem)
    bpy.props = SimpleNamespace(
        **dict.fromkeys(("StringProperty", "BoolProperty", "IntProperty"), lambda **_options: str)
    )
    bpy.types = SimpleNamespace(
        Operator=type("Operator", (), {}),
        FileHandler=type("FileHandler", (), {}),
        TOPBAR_MT_file_import=SimpleNamespace(append=menus.append, remove=menus.remove),
        TOPBAR_MT_file_export=SimpleNamespace(append=menus.append, remove=menus.remove),
    )
    bpy.utils = SimpleNamespace(register_class=classes.append, unregister_class=classes.remove)
    utils = types.ModuleType("bpy_extras.io_utils")
    utils.ImportHelper, utils.ExportHelper = type("ImportHelper", (), {}), type("ExportHelper", (), {})
    for name, module in {"bpy": bpy, "bpy.app.handlers": handlers, "bpy_extras.io_utils": utils}.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "bpy.app", types.ModuleType("bpy.app"))
    monkeypatch.setitem(sys.modules, "bpy_extras", types.ModuleType("bpy_extras"))
    spec = importlib.util.spec_from_file_location(
        "reel_addon", ADDON / "__init__.py", submodule_search_locations=[str(ADDON)]
    )
    addon = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "reel_addon", addon)
    spec.loader.exec_module(addon)
    yield SimpleNamespace(addon=addon, handlers=handlers, menus=menus, classes=classes)
    for name in ("reel_addon.reel", "reel_addon.scene"):
        sys.modules.pop(name, None)


def scene(frame: int = 1, fps: int = 24) -> Any:
    found = SimpleNamespace(frame_current=frame, frame_end=1, render=SimpleNamespace(fps=fps, fps_base=1.0), objects=[])
    collection = SimpleNamespace(objects=SimpleNamespace(link=found.objects.append))
    return SimpleNamespace(scene=found, collection=collection)


def test_an_imported_file_follows_the_timeline(blender):
    video, context = meshreel.open(COLORED), scene(frame=10)
    [added] = blender.addon.import_reel(context, str(COLORED))
    assert context.scene.objects == [added] and len(added.data.materials) == 1
    seconds = len(video) / video.frame_rate
    assert context.scene.frame_end == 10 + round(24 * seconds) - 1
    for moment in range(context.scene.frame_end + 3):
        context.scene.frame_current = moment
        blender.addon.follow(context.scene)
        number = sum(time - video.timestamps[0] <= (moment - 10) / 24 + 1e-5 for time in video.timestamps[1:])
        places = added.data.vertices.values["co"].reshape(-1, 3)
        mesh = video[number]
        np.testing.assert_allclose(places, mesh.vertices[:, [0, 2, 1]] * [1, -1, 1], atol=1e-5)
        np.testing.assert_array_equal(added.data.loops.values["vertex_index"].reshape(-1, 3), mesh.faces)
        colors = added.data.color_attributes[0].data.values["color_srgb"].reshape(-1, 4)
        np.testing.assert_array_equal(np.round(255 * colors[:, :3]), mesh.colors)


@pytest.mark.usefixtures("blender")
def test_each_axis_that_points_up_becomes_z():
    for up, above in UP_AXES.items():
        turned = np.array(sys.modules["reel_addon.reel"].AXES[up])
        np.testing.assert_array_equal(turned @ above, [0, 0, 1])
        assert np.linalg.det(turned) == 1


def test_a_lost_file_stops_neither_the_timeline_nor_other_objects(blender, capsys):
    context = scene()
    [first], [second] = (blender.addon.import_reel(context, str(COLORED)) for _ in "ab")
    first["meshreel_file"] = "lost.reel"
    context.scene.frame_current = 2
    blender.addon.follow(context.scene)
    assert "lost.reel" in capsys.readouterr().out
    assert second["meshreel_shown"] > 0
    context.scene.objects.append(ObjectData("other", MeshData()))
    blender.addon.follow(context.scene)


def test_the_operator_says_what_is_wrong_with_a_file(blender, tmp_path):
    operator, told = blender.addon.ImportReel(), []
    operator.report = lambda kind, text: told.append((kind, text))
    operator.filepath, operator.textures, operator.audio = str(tmp_path / "none.reel"), True, True
    assert operator.execute(scene()) == {"CANCELLED"} and "none.reel" in told[0][1]
    operator.filepath = str(COLORED)
    assert operator.execute(scene()) == {"FINISHED"}


def test_switching_it_off_leaves_nothing(blender):
    blender.addon.register()
    assert blender.handlers.frame_change_pre and blender.menus and len(blender.classes) == 3
    blender.addon.unregister()
    assert not (blender.handlers.frame_change_pre or blender.menus or blender.classes)


def test_the_manifest_has_the_version_of_the_package():
    manifest = tomllib.loads((ADDON / "blender_manifest.toml").read_text())
    assert manifest["version"] == meshreel.__version__ and manifest["id"] == "meshreel"
