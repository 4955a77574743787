"""The demo's scene: people are closed, have faces and hands, and walk without sliding; cameras see all of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label

from meshreel.capture.simulated.acting import ARRIVAL, PERIOD, stances
from meshreel.capture.simulated.dress import CHILD, WOMAN, dressed_colors
from meshreel.capture.simulated.parlour import SIZE, furniture
from meshreel.capture.simulated.person import (
    ANKLE,
    ARM,
    EYE,
    FOREARM,
    SHOULDER,
    UPPER_ARM,
    WRIST,
    Build,
    finger_joints,
    folds,
    head_place,
    person,
)
from meshreel.capture.simulated.sculpture import depths, meshed
from meshreel.capture.simulated.skeleton import Limb, Stance, bends, carried, placed, weights
from meshreel.capture.simulated.stage import CAST, FACES, StageOptions, stage, stage_cameras
from meshreel.errors import InputError
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import border_edges, components
from tests.capture.simulated.test_demo_room import volume

SCENE = stage()


def still() -> Stance:
    """The stance of the still pose."""
    hands, feet = [], []
    for side in (np.array([1.0, 1.0, 1.0]), np.array([-1.0, 1.0, 1.0])):
        hands.append(Limb(side * (SHOULDER + 0.995 * (UPPER_ARM + FOREARM) * ARM), np.array([0.0, 0.0, -1.0]), 0.0))
        feet.append(Limb(side * ANKLE, np.array([0.0, 0.0, 1.0]), 0.0))
    return Stance(np.zeros(3), 0.0, 0.0, (hands[0], hands[1]), (feet[0], feet[1]))


@pytest.mark.parametrize("number", [0, 14, 26])
def test_a_person_is_one_closed_surface_in_every_stance(number: int) -> None:
    for mesh in SCENE.people(number):
        assert not len(border_edges(mesh)) and components(mesh.faces, len(mesh.vertices)).max() == 0
        assert 0.95 * FACES < len(mesh.faces) <= FACES


@pytest.mark.parametrize("build", [build for build, _ in CAST])
def test_a_coarser_lattice_gives_one_closed_surface_too(build: Build) -> None:
    mesh = meshed(person(build), 0.01, 8000)
    assert not len(border_edges(mesh)) and components(mesh.faces, len(mesh.vertices)).max() == 0


def test_an_adult_is_seven_and_a_half_heads_high_and_a_child_six() -> None:
    for (build, _), heads, height in zip(CAST, (7.6, 6.0), (1.68, 1.19), strict=True):
        mesh = SCENE.cast[CAST.index((build, _))].mesh
        chin = head_place(build)[1] - 0.112 * build.head
        whole = np.ptp(mesh.vertices[:, 1])
        assert whole / (mesh.vertices[:, 1].max() - chin) == pytest.approx(heads, abs=0.6)
        assert build.size * whole == pytest.approx(height, abs=0.05)


def test_a_hand_has_four_fingers_and_a_thumb() -> None:
    """Across the fingers, and across the palm with the thumb beside it, a section has so many pieces."""
    mesh, axes = SCENE.cast[0].mesh, np.stack([np.cross(ARM, [0, 0, 1.0]), [0, 0, 1.0]], axis=1)
    for along, pieces in ((0.128, 4), (0.072, 2)):
        grid = np.stack(
            np.meshgrid(np.arange(-0.03, 0.03, 0.001), np.arange(-0.06, 0.08, 0.001), indexing="ij"), axis=-1
        )
        points = WRIST + along * ARM + grid @ axes.T
        inside = depths(person(Build()), points.astype(np.float32)) < 0
        assert label(inside)[1] == pieces
    tips = np.array([joints[-1] for joints in finger_joints()])
    gaps = np.linalg.norm(mesh.vertices[:, None] - tips, axis=2).min(axis=0)
    assert gaps.max() < 0.012  # the mesh still has all five


@pytest.mark.parametrize(("build", "look"), CAST)
def test_eyes_have_a_pupil_in_the_iris_in_the_white(build, look) -> None:
    middle = head_place(build) + build.head * np.array([EYE[0], EYE[1] + 0.0006, 0.0775])
    places = middle + build.head * np.array([[0.0, 0, 0], [-0.0045, 0, 0], [-0.0105, 0, 0], [0.0, -0.03, 0]])
    pupil, iris, white, cheek = dressed_colors(build, look, places)
    assert pupil.max() < 40 and white.min() > 180
    assert np.abs(iris - look.iris).max() < 40
    assert np.abs(cheek - look.skin).max() < 60


def test_clothes_skin_and_hair_have_their_colors() -> None:
    places = np.array([[0.0, 1.2, 0.11], [0.09, 0.6, 0.07], [0.10, 0.05, 0.16], [0.0, 1.74, -0.02]])
    for (build, look), mesh in zip(CAST, (actor.mesh for actor in SCENE.cast), strict=True):
        near = mesh.vertices[np.linalg.norm(mesh.vertices[:, None] - places, axis=2).argmin(axis=0)]
        shirt, leg, toe, crown = dressed_colors(build, look, near)
        assert min(np.abs(shirt - color).max() for color in (look.shirt, look.stripe)) < 30
        assert np.abs(leg - look.trousers).max() < 70
        assert toe.min() > 200 and crown.sum() < 1.6 * sum(look.hair)
        hand = dressed_colors(build, look, (WRIST + 0.06 * ARM)[None])[0]
        assert np.abs(hand - look.skin).max() < 45
    assert CHILD != WOMAN


def test_bones_at_rest_leave_the_person_as_it_is() -> None:
    assert np.abs(placed(still())[:, :, :3] - np.eye(3)).max() < 0.12  # limbs are never quite straight
    mesh = SCENE.cast[0].mesh
    shares = weights(mesh)
    assert shares.min() >= 0 and shares.sum(axis=1) == pytest.approx(1)
    assert (
        np.quantile(np.linalg.norm(carried(mesh, shares, Build(), still()).vertices - mesh.vertices, axis=1), 0.9)
        < 0.03
    )


def test_a_bent_elbow_has_deeper_folds() -> None:
    actor, straight = SCENE.cast[0], still()
    up = Limb(np.array([0.34, 1.55, 0.14]), np.array([0.8, -1.0, -0.1]), 0.0)
    inner = np.abs((actor.mesh.vertices - SHOULDER) @ ARM - UPPER_ARM) < 0.05
    inner &= actor.mesh.vertices[:, 0] > 0.25
    raised = replace(straight, hands=(up, straight.hands[1]))
    low, deep = (np.ptp(folds(actor.mesh.vertices, bends(placed(now)), 0.085)[inner]) for now in (straight, raised))
    assert deep > 2 * low > 0


def test_feet_stand_still_while_they_carry_and_people_move_no_faster_than_they_can() -> None:
    rate = 60.0
    woman = [stances(number / rate)[0] for number in range(round(ARRIVAL * rate) + 30)]
    way = np.array([np.sin(0.70), 0.0, np.cos(0.70)])
    for side in (0, 1):
        ankles = np.array([now.place @ way + now.feet[side].place[2] for now in woman])
        down = np.array([now.feet[side].place[1] < 0.0851 and now.feet[side].bend == 0 for now in woman])
        both = down[1:] & down[:-1]
        assert both.sum() > 20 and np.abs(np.diff(ankles)[both]).max() < 1e-9
    for number in range(11, 22):
        for mesh, then in zip(SCENE.people(number), SCENE.people(number + 1), strict=True):
            assert np.linalg.norm(then.vertices - mesh.vertices, axis=1).max() < 0.26  # m in 1/20 s: hands of a jump


def test_nobody_leaves_the_room_sinks_into_the_floor_or_meets_anything() -> None:
    things = furniture()[1:]
    for number in (0, 8, 16, 30, 39):
        woman, child = SCENE.people(number)
        assert np.linalg.norm(woman.vertices[::9, None, ::2] - child.vertices[None, ::9, ::2], axis=2).min() > 0.05  # m
        for mesh in (woman, child):
            assert mesh.vertices[:, 1].min() > -0.01
            assert (np.abs(mesh.vertices[:, [0, 2]]) < np.array(SIZE)[[0, 2]] / 2).all()
            for thing in things:
                low, high = thing.mesh.vertices.min(axis=0), thing.mesh.vertices.max(axis=0)
                beyond = np.maximum(np.maximum(low - mesh.vertices, mesh.vertices - high), 0)
                assert np.linalg.norm(beyond, axis=1).min() > 0.02


def test_the_child_jumps_again_as_before() -> None:
    for time in (0.0, 0.7, 1.3, PERIOD - 1e-9):
        now, then = (stances(time + k * PERIOD)[1] for k in (0, 1))
        assert now.place == pytest.approx(then.place) and now.head[:2] == pytest.approx(then.head[:2])
    before, after = stances(PERIOD - 1e-6)[1], stances(PERIOD)[1]
    assert before.lift == pytest.approx(after.lift, abs=1e-4) and before.head == pytest.approx(after.head, abs=1e-4)


def test_things_face_outward_and_their_colors_are_colors() -> None:
    room, *things = furniture()
    assert len(border_edges(room.mesh)) > 0  # open at the front and above
    for thing in things:
        assert not len(border_edges(thing.mesh)) and volume(thing.mesh) > 0.003
    for thing in (room, *things):
        colors = thing.paint(thing.mesh.vertices)
        assert np.isfinite(colors).all() and colors.min() > 10 and colors.max() < 262


def test_every_camera_sees_both_people_and_the_room_and_most_see_faces() -> None:
    frame = SCENE[12]
    woman = len(SCENE.cast[0].mesh.faces)
    first = int(np.argmax(frame.dynamic))
    for camera in stage_cameras(128):
        faces = draw(frame.mesh, camera.view).faces
        seen = faces[faces >= 0]
        own = seen[frame.dynamic[seen]] - first
        assert min((own < woman).sum(), (own >= woman).sum()) > 60  # pixels
        assert (~frame.dynamic[seen]).mean() > 0.4


def test_light_is_soft_and_the_same_place_has_the_same_color_in_every_stance() -> None:
    actor, (one, two) = SCENE.cast[0], (SCENE.people(number)[0] for number in (0, 20))
    faces = np.arange(0, len(actor.mesh.faces), 50)
    colors = [actor.colors(mesh, mesh.vertices[mesh.faces[faces]].mean(axis=1), faces) for mesh in (one, two)]
    still = dressed_colors(actor.build, actor.look, actor.mesh.vertices[actor.mesh.faces[faces]].mean(axis=1))
    for lit in colors:
        share = lit.sum(axis=1) / np.maximum(still.sum(axis=1), 1)
        assert share.min() > 0.1 and share.max() < 1.1 and np.median(share) > 0.5


def test_a_frame_is_the_same_whenever_it_is_made() -> None:
    other = stage(StageOptions(frames=8))
    assert np.array_equal(SCENE[4].mesh.vertices, other[-4].mesh.vertices)
    assert np.array_equal(SCENE[4].mesh.faces, other[4].mesh.faces)
    with pytest.raises(IndexError):
        other[8]
    actor = SCENE.cast[1]
    again = meshed(person(actor.build), 0.005, FACES)
    assert np.array_equal(again.vertices, actor.mesh.vertices) and np.array_equal(again.faces, actor.mesh.faces)


@pytest.mark.parametrize("options", [{"frames": 0}, {"frame_rate": 0.0}])
def test_impossible_options_are_refused(options: dict) -> None:
    with pytest.raises(InputError, match=r"ask|give"):
        StageOptions(**options)
