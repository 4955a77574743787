"""Settings and presets: what a user chooses sets every option, and is said once."""

import inspect
import math
from dataclasses import fields, replace
from itertools import pairwise

import pytest

from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.paper.recipe import PaperOptions
from meshreel.encoder.sequence import encode
from meshreel.encoder.settings.options import EncoderOptions, displacement_step, reference_vertices
from meshreel.encoder.settings.settings import EFFORTS, PRESETS, Settings
from meshreel.errors import InputError

NAN = math.nan


def test_the_default_options_are_those_that_encode_takes_by_default():
    assert EncoderOptions() == Settings().resolved() == Settings("best", 50.0).resolved()
    assert Settings("paper").resolved().method == PaperOptions()


def test_encode_takes_the_settings_as_keywords_with_the_same_defaults_and_types():
    keywords = inspect.signature(encode).parameters
    for field in fields(Settings):
        assert (keywords[field.name].default, keywords[field.name].annotation) == (field.default, field.type)


def test_every_setting_reaches_its_option():
    assert Settings(dynamic_only=True).resolved().scene is None
    assert Settings(background_refresh=2.0).resolved().scene.refresh == 2.0
    assert Settings(close_planes=True).resolved().scene.close_planes and not Settings().resolved().scene.close_planes
    assert Settings(group_size=7).resolved().method.group_size == 7
    assert Settings(key_interval=1.5).resolved().key_interval == 1.5
    assert Settings("paper", basis_size=3, centers=80).resolved().method.displacements.basis_size == 3
    textures = Settings(color="texture", texture=256, compatible=True, splats=9).resolved().appearance
    assert textures.texture.always and textures.texture.compatible
    assert (textures.texture.size, textures.splats) == (256, 9)
    assert Settings(color_quality=80).resolved().appearance.color_step < Settings().resolved().appearance.color_step


@pytest.mark.parametrize(
    ("given", "words"),
    [
        *(({"quality": quality}, "0 to 100") for quality in (-1, 100.5, NAN)),
        *(({"key_interval": at}, "key interval .*at most 600") for at in (0.0, -1.0, 600.1, 1e308, math.inf, NAN)),
        ({"preset": "worst"}, "'worst'; known: best, paper, paper-literal"),
        ({"basis_size": 4}, "basis size 4: .*use preset `paper`"),
        ({"centers": 300}, "centers 300: .*use preset `paper`"),
        ({"preset": "paper", "key_interval": 2.0}, "key interval 2: .*`paper`"),
        ({"preset": "paper", "basis_size": -1}, "basis size.*-1"),
        ({"preset": "paper", "centers": 0}, "centers.*0"),
        ({"effort": "lazy"}, "no effort is called 'lazy'; known: fast, normal, thorough"),
        ({"preset": "paper", "effort": "fast"}, "effort fast: preset `paper` has one effort"),
        ({"background_refresh": 0.0}, "background refresh"),
        ({"preset": "paper", "centers": 10**12}, "centers .*at most 100000"),
        *(({name: 1.5}, f"{name.replace('_', ' ')} 1.5: give a whole number") for name in ("group_size", "splats")),
        ({"preset": "paper", "centers": NAN}, "centers nan: give a whole number"),
        *(({name: "3"}, "'3': give a number") for name in ("quality", "key_interval", "background_refresh")),
        ({"background_refresh": 1.0, "dynamic_only": True}, "background refresh"),
        ({"close_planes": True, "dynamic_only": True}, "close planes"),
    ],
)
def test_settings_that_make_no_sense_are_refused_with_the_remedy(given, words):
    with pytest.raises(InputError, match=words):
        Settings(**given)


def test_the_laplacian_form_follows_the_quality():
    for quality in (0, 25, 50, 100):
        steps = {Settings(preset, quality).resolved().method.displacements.step for preset in PRESETS[1:]}
        assert steps == {displacement_step(quality)}


def test_more_quality_means_finer_steps_and_more_vertices():
    qualities = range(0, 101, 10)
    steps = [displacement_step(q) for q in qualities]
    vertices = [reference_vertices(q) for q in qualities]
    assert steps == sorted(steps, reverse=True) and vertices == sorted(vertices)
    assert len(set(steps)) == len(set(vertices)) == len(qualities)
    best = [Settings("best", q).resolved().method for q in qualities]
    assert all(a.layers.step > b.layers.step and a.template_error > b.template_error for a, b in pairwise(best))
    assert all(a.target.distance > b.target.distance for a, b in pairwise(best))


def test_above_the_knee_steps_fall_faster_and_at_the_top_the_target_must_be_reached():
    low, knee, high, top = (Settings("best", quality).resolved().method for quality in (60, 85, 97, 100))
    assert low.layers.step == pytest.approx(2 * knee.layers.step) and knee.flat == high.flat == low.flat
    assert high.layers.step < knee.layers.step / 2 and high.target.angle == low.target.angle
    assert top.flat == 1.0 and top.target.angle < 2.5 and top.target.distance < 1e-4  # 80 dB of the diagonal
    first = Settings("best", 99).resolved().method  # the first that may give way to Draco: less fine
    assert first.target.distance > top.target.distance and 2.0 > first.target.angle > top.target.angle
    assert set(top.intra.fractions) > set(high.intra.fractions) - {0.25, 0.5}


def test_the_literal_preset_differs_from_the_paper_in_every_choice_and_is_recorded():
    ours, words = (Settings(name).resolved().method for name in ("paper", "paper-literal"))
    assert all(getattr(ours, name) != getattr(words, name) for name in ("pose", "fit", "cuts"))
    assert ours.displacements.dead_zone is None and len(ours.displacements.offsets) > 1
    assert (words.displacements.dead_zone, words.displacements.offsets) == (0.5, (0,))
    assert EncoderOptions(method=words).preset == "paper-literal"
    assert EncoderOptions(method=replace(words, fit="surface")).preset == "paper"


@pytest.mark.parametrize("wrong", [{"measured": 0}, {"measured": -1}, {"errors": (0.0,)}, {"errors": (0.8, -1.0)}])
def test_searches_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError, match="give frames >= 1, and factors > 0"):
        LayersOptions(**wrong)


def test_less_effort_tries_fewer_keys_with_fewer_samples_and_the_default_is_normal():
    fast, normal, thorough = (Settings(effort=effort).resolved().method for effort in EFFORTS)
    assert fast.plan.keys < normal.plan.keys < thorough.plan.keys
    assert fast.embedded.samples < normal.embedded.samples and not fast.tails
    assert Settings().resolved().method == normal and fast.layers == normal.layers == thorough.layers


def test_many_centers_bring_the_samples_they_need():
    assert Settings("paper", centers=20_000).resolved().method.track.samples >= 80_000


def test_the_recipe_names_the_preset_that_a_file_records() -> None:
    assert EncoderOptions(method=PaperOptions()).preset == "paper"
    assert EncoderOptions(method=LayersOptions()).preset == "best"
