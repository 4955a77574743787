"""Run by an interpreter that has bpy: `in_blender.py FUNCTION ARGUMENTS...`; prints as JSON what the function finds."""

import importlib.util
import json
import os
import sys
from pathlib import Path

import bpy
import numpy as np

ADDON = Path(__file__).resolve().parents[2] / "engines" / "blender"


def addon():
    """Load the add-on and switch it on, in an empty scene at 24 frames a second, at its frame 10."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    spec = importlib.util.spec_from_file_location(
        "reel_addon", ADDON / "__init__.py", submodule_search_locations=[str(ADDON)]
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules["reel_addon"] = module
    spec.loader.exec_module(module)
    module.register()
    bpy.context.scene.render.fps, bpy.context.scene.frame_end = 24, 1
    bpy.context.scene.frame_set(10)
    return module


def values(elements, name, width):
    found = np.empty(width * len(elements), np.int32 if name == "vertex_index" else np.float32)
    elements.foreach_get(name, found)
    return found.tolist()


def imported(path):
    addon()
    bpy.ops.import_scene.reel(filepath=path)
    scene = bpy.context.scene
    [shown, *_] = scene.objects
    frames = []
    for frame in (10, 11, 12, 14, 11, 9, 30):
        scene.frame_set(frame)
        mesh = shown.data
        row = {
            "frame": frame,
            "number": shown["meshreel_shown"],
            "places": values(mesh.vertices, "co", 3),
            "faces": values(mesh.loops, "vertex_index", 1),
        }
        if mesh.uv_layers:
            node = mesh.materials[0].node_tree.nodes["meshreel pictures"]
            row |= {
                "uv": values(mesh.uv_layers["UVMap"].data, "uv", 2),
                "colors": values(mesh.color_attributes["Color"].data, "color_srgb", 4),
                "picture": node.image_user.frame_offset + frame - node.image_user.frame_start + 1,
            }
        frames.append(row)
    editor = scene.sequence_editor
    strips = [] if editor is None else (editor.strips if hasattr(editor, "strips") else editor.sequences)
    return {
        "objects": [{"name": each.name} for each in scene.objects],
        "frames": frames,
        "end": scene.frame_end,
        "hears": bpy.app.build_options.audaspace,
        "strips": [[s.type, bpy.path.abspath(s.sound.filepath), s.channel, int(s.frame_start)] for s in strips],
    }


def rendered(path):
    """Render a square that shows the whole texture, by the add-on's material, without light but its own."""
    module = addon()
    [shown] = module.import_reel(bpy.context, path)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 16, "CPU"
    scene.render.resolution_x, scene.render.resolution_y = 64, 32  # a pixel for each texel
    scene.cycles.filter_width = 0.01
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    material = shown.data.materials[0]
    nodes, links = material.node_tree.nodes, material.node_tree.links
    emission = nodes.new("ShaderNodeEmission")
    links.new(nodes["Principled BSDF"].inputs["Base Color"].links[0].from_socket, emission.inputs["Color"])
    links.new(emission.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
    bpy.ops.mesh.primitive_plane_add(size=2)  # with a UV map of the same name
    plane = bpy.context.object
    plane.scale.y = 0.5
    plane.data.materials.append(material)
    shown.hide_render = True
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2
    numbers, pictures = [], []
    for frame in (10, 12, 14):
        scene.frame_set(frame)
        scene.render.filepath = str(Path(path).with_name(f"render_{frame}.exr"))
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        numbers.append(shown["meshreel_shown"])
        pictures.append(np.array(image.pixels[:]).reshape(32, 64, 4)[::-1, :, :3].tolist())  # from the top
    return {"numbers": numbers, "pictures": pictures}


def exported(path):
    addon()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 10, 2
    errors = []
    try:
        bpy.ops.export_scene.reel(filepath=path)
    except RuntimeError as error:
        errors.append(str(error).removeprefix("Error: ").strip())
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12)
    ball = bpy.context.object
    ball.scale = (-1, 1, 0.5)  # mirrored
    colors = ball.data.color_attributes.new("paint", "FLOAT_COLOR", "CORNER")
    colors.data.foreach_set("color_srgb", [1, 128 / 255, 0, 1] * len(ball.data.loops))
    ball.modifiers.new("finer", "SUBSURF").levels = 1
    for frame, x in ((1, 0), (10, 2)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    scene.frame_set(3)
    bpy.ops.export_scene.reel(filepath=path)
    boxes, kept = [], scene.frame_current
    for frame in range(1, 11, 2):
        scene.frame_set(frame)
        drawn = ball.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = drawn.to_mesh()
        points = np.array([tuple(drawn.matrix_world @ vertex.co) for vertex in mesh.vertices])
        boxes.append([*points.min(axis=0), *points.max(axis=0)])
    return {"boxes": boxes, "frame": kept, "refused": errors[0]}


def refused(path):
    addon()
    try:
        bpy.ops.import_scene.reel(filepath=path)
    except RuntimeError as error:
        return {"error": str(error)}
    return {"error": ""}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(globals()[sys.argv[1]](*sys.argv[2:])) + "\n")
    sys.stdout.flush()
    os._exit(0)  # bpy 4.2 crashes where Python ends, after its work
