"""Blender add-on: imports .reel files as objects whose mesh follows the timeline, and exports meshes as .reel files.

An object knows its file, its part and the frame at which it begins; before each frame of the scene its mesh is
replaced. Of the video a .blend file has the frame that was shown last. Textures and audio become files beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.app.handlers import persistent
from bpy_extras.io_utils import ExportHelper, ImportHelper

from meshreel import MeshreelError

from .reel import Arrays, arrays_of, frame_of, opened, parts_of, scene_frames, write_audio, write_textures
from .scene import encode_scene

# Custom properties of an object.
FILE, PART, START, SHOWN = "meshreel_file", "meshreel_part", "meshreel_start", "meshreel_shown"
COLORS, PLACES = "Color", "UVMap"  # attributes that the material shows
PICTURES = "meshreel pictures"  # the material's node of the texture


def import_reel(context: Any, path: str, textures: bool = True, audio: bool = True) -> list[Any]:
    """Add objects that play a file from the present frame on: one, or one for each part where parts have textures.

    Raises MeshreelError where the file cannot be read, and OSError where textures or audio cannot be written beside it.
    """
    video, scene, start = opened(path), context.scene, context.scene.frame_current
    name, folder = bpy.path.display_name_from_filepath(path), Path(path).with_name(f"{Path(path).stem}_textures")
    files = {part: write_textures(video, part, folder) if part and textures else [] for part in parts_of(video)}
    sound = write_audio(video, Path(path)) if audio else None
    added = [_object(f"{name} {part}".strip(), {FILE: path, PART: part, START: start, SHOWN: -1}) for part in files]
    for each, pictures in zip(added, files.values(), strict=True):
        show(each, scene)
        if pictures or each.data.color_attributes:
            each.data.materials.append(material_of(each.name, pictures))
        each[SHOWN] = -1
        show(each, scene)  # the material knows the picture, too
        context.collection.objects.link(each)
    if sound is not None and bpy.app.build_options.audaspace:  # else this Blender has no sound
        add_sound(scene, name, *sound)
    scene.frame_end = max(scene.frame_end, start + scene_frames(video, rate_of(scene)) - 1)
    return added


def _object(name: str, properties: dict[str, Any]) -> Any:
    added = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    for key, value in properties.items():
        added[key] = value
    return added


def add_sound(scene: Any, name: str, path: Path, seconds: float) -> None:
    """Add a strip of an audio file, so many seconds after the present frame, above all strips that are there."""
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # the second before Blender 4.4
    channel = max((strip.channel for strip in strips), default=0) + 1
    begin = scene.frame_current + round(seconds * rate_of(scene))
    strips.new_sound(name=name, filepath=str(path), channel=channel, frame_start=begin)


def show(shown: Any, scene: Any) -> None:
    """Give an object the mesh of the scene's present frame, unless it has it."""
    video = opened(bpy.path.abspath(shown[FILE]))
    number = frame_of(video, scene.frame_current, shown[START], rate_of(scene))
    if number != shown[SHOWN]:
        fill(shown.data, arrays_of(video, number, shown.get(PART, "")))
        shown[SHOWN] = number
    for material in shown.data.materials:
        node = material.node_tree.nodes.get(PICTURES)
        if node is not None:  # a sequence of one frame, the present one, which is file 1 before the offset
            node.image_user.frame_start, node.image_user.frame_offset = scene.frame_current, number - 1


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
    if arrays.uv is not None:
        mesh.uv_layers.new(name=PLACES).data.foreach_set("uv", arrays.uv)
    mesh.update(calc_edges=True)


def material_of(name: str, pictures: list[Path]) -> Any:
    """Return a material that shows the colours of vertices, and the pictures where a face has a place in them."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    attribute = nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = COLORS
    shown = attribute.outputs["Color"]
    if pictures:
        shown = textured(nodes, links, shown, pictures)
    links.new(shown, nodes["Principled BSDF"].inputs["Base Color"])
    return material


def textured(nodes: Any, links: Any, color: Any, pictures: list[Path]) -> Any:
    """Add nodes that show the pictures where places are not below 0, and elsewhere a colour; return their output."""
    places, split, covered, mix = map(
        nodes.new, ("ShaderNodeUVMap", "ShaderNodeSeparateXYZ", "ShaderNodeMath", "ShaderNodeMixRGB")
    )
    texture = nodes.new("ShaderNodeTexImage")
    texture.name, places.uv_map = PICTURES, PLACES
    texture.image = bpy.data.images.load(str(pictures[0]))
    texture.image.source = "SEQUENCE"
    texture.image_user.frame_duration, texture.image_user.use_auto_refresh = 1, True
    covered.operation = "GREATER_THAN"
    covered.inputs[1].default_value = -0.5
    for source, target in (
        (places.outputs["UV"], texture.inputs["Vector"]),
        (places.outputs["UV"], split.inputs["Vector"]),
        (split.outputs["X"], covered.inputs[0]),
        (covered.outputs["Value"], mix.inputs["Fac"]),
        (color, mix.inputs["Color1"]),
        (texture.outputs["Color"], mix.inputs["Color2"]),
    ):
        links.new(source, target)
    return mix.outputs["Color"]


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
    textures: bpy.props.BoolProperty(name="Textures, as PNG files beside it", default=True)
    audio: bpy.props.BoolProperty(name="Audio, as a file beside it", default=True)

    def execute(self, context: Any) -> set[str]:
        """Import the chosen file; Blender shows what is wrong with it."""
        return told(self, lambda: import_reel(context, self.filepath, self.textures, self.audio))


class ExportReel(bpy.types.Operator, ExportHelper):
    """Export the selected meshes, as they move from the scene's first frame to its last."""

    bl_idname = "export_scene.reel"
    bl_label = "Export meshreel"
    filename_ext = ".reel"
    filter_glob: bpy.props.StringProperty(default="*.reel", options={"HIDDEN"})
    quality: bpy.props.IntProperty(name="Quality", default=50, min=0, max=100)

    def execute(self, context: Any) -> set[str]:
        """Export to the chosen file; Blender shows what is wrong, and an older file stays then."""
        return told(self, lambda: encode_scene(context, self.filepath, self.quality))


def told(operator: Any, run: Any) -> set[str]:
    """Run an operator's work; Blender shows what was wrong."""
    try:
        run()
    except (MeshreelError, OSError, ImportError) as error:
        operator.report({"ERROR"}, str(error))
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


def export_menu(self: Any, _context: Any) -> None:
    """Add the entry to File > Export."""
    self.layout.operator(ExportReel.bl_idname, text="meshreel (.reel)")


def register() -> None:
    """Called when the add-on is switched on."""
    for each in (ImportReel, ExportReel, ReelFile):
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_import.append(menu)
    bpy.types.TOPBAR_MT_file_export.append(export_menu)
    bpy.app.handlers.frame_change_pre.append(follow)


def unregister() -> None:
    """Called when the add-on is switched off."""
    bpy.app.handlers.frame_change_pre.remove(follow)
    bpy.types.TOPBAR_MT_file_export.remove(export_menu)
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    for each in (ReelFile, ExportReel, ImportReel):
        bpy.utils.unregister_class(each)
