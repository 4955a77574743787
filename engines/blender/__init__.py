"""Blender add-on: imports .reel files as objects whose mesh follows the timeline.

An object knows its file and the frame at which it begins; before each frame of the scene its mesh is replaced. Of the
video a .blend file has the frame that was shown last.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent
from bpy_extras.io_utils import ImportHelper

from meshreel import MeshreelError

from .reel import Arrays, arrays_of, frame_of, opened, scene_frames

FILE, START, SHOWN = "meshreel_file", "meshreel_start", "meshreel_shown"  # custom properties of an object
COLORS = "Color"  # the attribute that the material shows


def import_reel(context: Any, path: str) -> Any:
    """Add an object that plays a file from the present frame on. Raises MeshreelError where it cannot be read."""
    video = opened(path)
    scene = context.scene
    name = bpy.path.display_name_from_filepath(path)
    mesh = bpy.data.meshes.new(name)
    added = bpy.data.objects.new(name, mesh)
    added[FILE], added[START], added[SHOWN] = path, scene.frame_current, -1
    show(added, scene)
    if mesh.color_attributes:
        mesh.materials.append(colored_material(name))
    context.collection.objects.link(added)
    scene.frame_end = max(scene.frame_end, scene.frame_current + scene_frames(video, rate_of(scene)) - 1)
    return added


def show(shown: Any, scene: Any) -> None:
    """Give an object the mesh of the scene's present frame, unless it has it."""
    video = opened(bpy.path.abspath(shown[FILE]))
    number = frame_of(video, scene.frame_current, shown[START], rate_of(scene))
    if number != shown[SHOWN]:
        fill(shown.data, arrays_of(video, number))
        shown[SHOWN] = number


def fill(mesh: Any, arrays: Arrays) -> None:
    """Replace the geometry of a mesh; its materials stay."""
    mesh.clear_geometry()
    mesh.vertices.add(len(arrays.places) // 3)
    mesh.vertices.foreach_set("co", arrays.places)
    mesh.loops.add(len(arrays.corners))
    mesh.loops.foreach_set("vertex_index", arrays.corners)
    mesh.polygons.add(len(arrays.starts))
    mesh.polygons.foreach_set("loop_start", arrays.starts)
    if arrays.colors is not None:
        colors = mesh.color_attributes.new(COLORS, "BYTE_COLOR", "POINT")
        colors.data.foreach_set("color_srgb", arrays.colors)
    mesh.update(calc_edges=True)


def colored_material(name: str) -> Any:
    """Return a material that shows the colours of vertices."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    attribute = nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = COLORS
    links.new(attribute.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return material


def rate_of(scene: Any) -> float:
    """Return the frames a second of a scene."""
    rate: float = scene.render.fps / scene.render.fps_base
    return rate


@persistent
def follow(scene: Any, _depsgraph: Any = None) -> None:
    """Show the present frame in each object that plays a file; those whose file is gone keep what they show."""
    for each in scene.objects:
        if FILE in each and each.type == "MESH":
            try:
                show(each, scene)
            except (MeshreelError, OSError) as error:
                print(f"meshreel: {each.name}: {error}")  # in Blender's console, where add-ons report


class ImportReel(bpy.types.Operator, ImportHelper):
    """Import a time-varying mesh that plays in the timeline."""

    bl_idname = "import_scene.reel"
    bl_label = "Import meshreel"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a set)
    filename_ext = ".reel"
    filter_glob: bpy.props.StringProperty(default="*.reel", options={"HIDDEN"})

    def execute(self, context: Any) -> set[str]:
        """Import the chosen file; Blender shows what is wrong with it."""
        try:
            import_reel(context, self.filepath)
        except (MeshreelError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class ReelFile(bpy.types.FileHandler):
    """Lets .reel files be dropped on the viewport."""

    bl_idname = "IO_FH_reel"
    bl_label = "meshreel"
    bl_import_operator = ImportReel.bl_idname
    bl_file_extensions = ".reel"

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        """Return whether files may be dropped here."""
        return context.area is not None and context.area.type == "VIEW_3D"


def menu(self: Any, _context: Any) -> None:
    """Add the entry to File > Import."""
    self.layout.operator(ImportReel.bl_idname, text="meshreel (.reel)")


def register() -> None:
    """Called when the add-on is switched on."""
    for each in (ImportReel, ReelFile):
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_import.append(menu)
    bpy.app.handlers.frame_change_pre.append(follow)


def unregister() -> None:
    """Called when the add-on is switched off."""
    bpy.app.handlers.frame_change_pre.remove(follow)
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    for each in (ReelFile, ImportReel):
        bpy.utils.unregister_class(each)
