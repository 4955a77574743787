"""Let trimesh load .reel files: `python trimesh_load.py scan.reel 3` prints frame 3 as `trimesh.load` returns it.

trimesh has no function that adds a format; its dictionary of loaders takes one, as a test checks.
"""

import sys

import trimesh

import meshreel


def load_reel(file_obj, frame: int = 0, **_) -> dict:
    """Return the parts of a frame, with colours and textures, as trimesh's loaders return a scene."""
    parts = meshreel.open(file_obj).parts(frame)
    geometry = {}
    for name, part in parts.items():
        if not part.is_empty:
            mesh = part.to_trimesh()
            geometry[name] = {"vertices": mesh.vertices, "faces": mesh.faces, "visual": mesh.visual, "process": False}
    return {"geometry": geometry}


trimesh.exchange.load.mesh_loaders["reel"] = load_reel

if __name__ == "__main__":
    print(trimesh.load(sys.argv[1], frame=int(sys.argv[2])))
