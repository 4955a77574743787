"""Two examples of each command, shown below its help. A test parses each of them."""

EXAMPLES = {
    "capture": ("rig -o scan --voxel 0.02", "scan.bag -o rig"),
    "calibrate": ("rig --in-place", "rig --board charuco --in-place"),
    "segment": ("room -o labels", "room -o views --views-only"),
    "survey": ("scan -o scan.json", "s3://takes/walk -o s3://takes/walk.json --fps 25"),
    "encode": ("scan -o scan.reel --quality 50 --fps 30", "'takes/walk_*.obj' -o walk.reel --audio walk.opus --jobs 4"),
    "cut": ("walk.reel -o step.reel --frames 30:90", "walk.reel -o step.reel --frames 30:90 --keys"),
    "concat": ("walk-1.reel walk-2.reel -o walk.reel", "s3://takes/walk-1.reel s3://takes/walk-2.reel -o walk.reel"),
    "retime": ("walk.reel -o film.reel --fps 24", "walk.reel -o slow.reel --speed 0.25"),
    "transform": (
        "walk.reel -o small.reel --scale 0.001",
        "walk.reel -o turned.reel --rotate 90 0 0 --up z",
    ),
    "tag": ("walk.reel title='A walk' take=3 -o tagged.reel", "walk.reel --audio walk.opus -o heard.reel"),
    "decode": ("scan.reel -o meshes --format ply", "room.reel -o background --only background"),
    "export": ("scan.reel --glb", "scan.reel -o scan.usdz --texture"),
    "info": ("scan.reel", "scan.reel --groups --json"),
    "compare": ("scan scan.reel --sheet errors.png", "'takes/walk_*.obj' walk.reel --scale 0.001 --no-ssim"),
    "play": ("scan.reel", "scan.reel --host 0.0.0.0 --https"),
    "serve": ("recordings --port 8000", "recordings --cors https://example.org"),
    "player": ("--copy-to site/player", ""),
    "demo": ("", "-o demo --frames 8 --jobs 2"),
    "doctor": ("", "--json"),
    "completion": ("bash >> ~/.bashrc", "zsh > ~/.zfunc/_meshreel"),
}


def epilogue(name: str) -> str:
    """Return the end of a command's help, in Markdown."""
    lines = [f"    meshreel {name} {arguments}".rstrip() for arguments in EXAMPLES.get(name, ())]
    return "\n".join(["Examples:", "", *lines]) if lines else ""
