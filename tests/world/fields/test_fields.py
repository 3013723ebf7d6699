"""Scalar fields, and the sensor that reads them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.interpolate import RegularGridInterpolator

from zwerm.catalogue import FIELDS
from zwerm.errors import ScenarioError
from zwerm.scenario.types import OpenTable
from zwerm.world.fields.bitmap import Bitmap
from zwerm.world.fields.registry import make_field

BOUNDS_M = (0.0, 0.0, 3.0, 2.0)
coordinate = st.floats(-1.0, 4.0)
points = st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=8).map(np.array)


def field_of(kind, folder=Path(), **parameters):
    return make_field(OpenTable.model_validate({"kind": kind, **parameters}), BOUNDS_M, folder, "x.toml")


@pytest.fixture(scope="session")
def picture(tmp_path_factory):
    """A folder with a picture of 6 x 4 random shades, and the shades, the top row first."""
    folder = tmp_path_factory.mktemp("pictures")
    shades = np.random.default_rng(2).integers(0, 256, (4, 6)).astype(np.uint8)
    Image.fromarray(shades).save(folder / "shades.png")
    return folder, shades


def test_each_kind_has_the_value_its_formula_gives():
    at = np.array([[0.5, 0.25], [2.0, 1.0]])
    assert field_of("constant", value=2.5).value(at).tolist() == [2.5, 2.5]
    assert field_of("linear", offset=1.0, gradient_per_m=[2.0, -4.0]).value(at).tolist() == [1.0, 1.0]
    bumps = field_of("gaussians", amplitudes=[3, 5], centers_m=[[0.5, 0.25], [2, 1]], sd_m=[0.5, 0.25], offset=1)
    far2 = 1.5**2 + 0.75**2
    expected = [4.0 + 5.0 * math.exp(-far2 / (2 * 0.0625)), 6.0 + 3.0 * math.exp(-far2 / (2 * 0.25))]
    assert bumps.value(at) == pytest.approx(expected)
    assert field_of("gaussians", amplitudes=[2], centers_m=[[0, 0]], sd_m=1).value(at[:1]) == pytest.approx(
        2.0 * math.exp(-(0.25 + 0.0625) / 2.0)
    )


@given(at=points)
@settings(max_examples=60, deadline=None)
@pytest.mark.parametrize("kind", ["constant", "linear", "gaussians", "bitmap"])
def test_the_gradient_equals_finite_differences_of_the_value(picture, kind, at):
    parameters: Any = {
        "constant": {"value": 2.0},
        "linear": {"gradient_per_m": [2.0, -1.0]},
        "gaussians": {"amplitudes": [3.0, -1.0], "centers_m": [[0.5, 0.5], [2.0, 1.0]], "sd_m": [0.4, 0.8]},
        "bitmap": {"file": "shades.png"},
    }[kind]
    field = field_of(kind, picture[0], **parameters)
    step = 1e-6
    if kind == "bitmap":  # its gradient jumps on the lines between patches, 0.5 m apart
        at = at[(np.abs(np.remainder(at, 0.5) - 0.25) > 2 * step).all(axis=1)]
    gradient = field.gradient(at)
    assert gradient.shape == (len(at), 2)
    for axis, shift in enumerate(np.eye(2) * step):
        change = (field.value(at + shift) - field.value(at - shift)) / (2.0 * step)
        assert gradient[:, axis] == pytest.approx(change, abs=1e-6)


@given(at=points)
@settings(max_examples=40, deadline=None)
def test_a_bitmap_covers_the_arena_in_the_orientation_of_its_picture(picture, at):
    folder, shades = picture
    field = field_of("bitmap", folder, file="shades.png", low=-1.0, high=3.0)
    x, y = np.arange(6) * 0.5 + 0.25, np.arange(4) * 0.5 + 0.25
    judge = RegularGridInterpolator((x, y), (-1.0 + 4.0 * shades[::-1] / 255.0).T)
    assert field.value(at) == pytest.approx(judge(np.clip(at, [x[0], y[0]], [x[-1], y[-1]])))


def test_a_bitmap_is_at_its_origin_with_its_size(picture):
    folder, shades = picture
    field = field_of("bitmap", folder, file="shades.png", origin_m=[1.0, 2.0], size_m=[12.0, 16.0])
    lower_left_pixel, upper_right_pixel = [2.0, 4.0], [12.0, 16.0]
    assert field.value(np.array([lower_left_pixel, upper_right_pixel])) == pytest.approx(
        [shades[3, 0] / 255.0, shades[0, 5] / 255.0]
    )


def test_pictures_of_one_pixel_and_of_sixteen_bits_are_fields_too(tmp_path):
    at = np.array([[0.3, 0.3], [2.9, 1.9]])
    one = Bitmap(np.array([[0.25]]), BOUNDS_M)
    assert one.value(at).tolist() == [0.25, 0.25]
    assert one.gradient(at).tolist() == [[0.0, 0.0], [0.0, 0.0]]
    Image.fromarray(np.array([[1000, 65535]], dtype=np.uint16)).save(tmp_path / "deep.png")
    deep = field_of("bitmap", tmp_path, file="deep.png")
    assert deep.value(at) == pytest.approx([1000 / 65535, 1.0])


@pytest.mark.parametrize(
    ("table", "lines"),
    [
        (
            {"kind": "hills"},
            [f"x.toml: field.kind: expected a built-in field ({', '.join(FIELDS)}) or module:Class, got 'hills'"],
        ),
        ({"kind": "constant"}, ["x.toml: field.value: required, and missing"]),
        (
            {"kind": "gaussians", "amplitudes": [1, 2], "centers_m": [[0, 0]], "sd_m": 0},
            [
                "x.toml: field.centers_m: expected 2 items, one for each of amplitudes, got [[0, 0]]",
                "x.toml: field.sd_m.0: expected > 0, got 0",
                "x.toml: field.sd_m.1: expected > 0, got 0",
            ],
        ),
        (
            {"kind": "bitmap", "file": "none.png"},
            ["x.toml: field.file: cannot be read: No such file or directory, got 'none.png'"],
        ),
        (
            {"kind": "bitmap", "file": "none.png", "origin_m": [1, 1]},
            ["x.toml: field.origin_m: expected size_m beside it, got [1, 1]"],
        ),
        ({"kind": "bitmap", "file": "notes.png"}, ["x.toml: field.file: not a picture, got 'notes.png'"]),
    ],
)
def test_a_mistake_in_the_table_is_one_line(tmp_path, table, lines):
    (tmp_path / "notes.png").write_text("no picture")
    with pytest.raises(ScenarioError) as caught:
        make_field(OpenTable.model_validate(table), BOUNDS_M, tmp_path, "x.toml")
    assert caught.value.mistakes == lines


@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi, -2.5])
def test_the_sensor_gives_the_gradient_in_the_body_frame(make_scene, sensor_for, heading):
    scene = make_scene([(1.0, 0.5, heading)])
    sensor = sensor_for(scene, "field", {"field": field_of("linear", offset=1.0, gradient_per_m=[2.0, -1.0])})
    (sample,) = sensor.read(scene, scene.present_ids())
    assert sample.value == pytest.approx(2.5)
    turn_back = complex(math.cos(heading), -math.sin(heading))
    assert complex(sample.gradient_x, sample.gradient_y) == pytest.approx(complex(2.0, -1.0) * turn_back)


def test_the_sensors_noise_has_the_given_spread_and_is_keyed(make_scene, sensor_for):
    poses = np.random.default_rng(1).uniform(0.1, 2.9, (200, 3))
    field = {"field": field_of("constant", value=5.0)}
    scene, more = make_scene(poses, tick=9), make_scene([*poses, (1.0, 1.0, 0.0)], tick=9)
    reading, other = (
        sensor_for(each, "field", field, sd=0.5, gradient_sd_per_m=2.0).read(each, each.present_ids())
        for each in (scene, more)
    )
    assert reading == other[:200]
    values = np.array([(each.value - 5.0, each.gradient_x, each.gradient_y) for each in reading])
    assert values.std(axis=0) == pytest.approx([0.5, 2.0, 2.0], rel=0.2)
    assert values.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=4 * 2.0 / math.sqrt(200))
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 4 / math.sqrt(200)


def test_a_field_of_a_users_own_is_named_by_its_module_and_class():
    field = make_field(
        OpenTable.model_validate({"kind": "own_fields:Waves", "length_m": 4.0}), (0, 0, 1, 1), Path(), "x.toml"
    )
    value, gradient = field.sample(np.array([[1.0, 0.0], [0.0, 0.0]]))
    assert value == pytest.approx([1.0, 0.0])
    assert gradient[1] == pytest.approx([np.pi / 2.0, 0.0])
    with pytest.raises(ScenarioError, match="module 'own_fields' has no class 'Nothing'"):
        make_field(OpenTable.model_validate({"kind": "own_fields:Nothing"}), (0, 0, 1, 1), Path(), "x.toml")
