"""Play a video with viser: `python viser_play.py scan.reel`, then open the address that it prints in a browser."""

import sys
import time

import viser

import meshreel


def serve(video: meshreel.Video) -> tuple[viser.ViserServer, viser.GuiInputHandle]:
    """Return a server that shows a frame, and the slider that chooses it."""
    server = viser.ViserServer(host="127.0.0.1")
    server.scene.set_up_direction({"y": "+y", "z": "+z"}.get(video.up, video.up))
    slider = server.gui.add_slider("frame", min=0, max=len(video) - 1, step=1, initial_value=0)

    @slider.on_update
    def show(_: object) -> None:
        for name, mesh in video.parts(slider.value).items():
            server.scene.add_mesh_trimesh(name, mesh.to_trimesh(), visible=not mesh.is_empty)

    show(None)
    return server, slider


if __name__ == "__main__":
    video = meshreel.open(sys.argv[1])
    _, slider = serve(video)
    while True:  # without the loop, call server.sleep_forever()
        slider.value = (slider.value + 1) % len(video)
        time.sleep(1 / video.frame_rate)
