"""A surface folded into one wedge: what leans in it is seen that neighbourhoods of the whole blur, and nothing else."""

import numpy as np
import pytest

from experiments.objects.boundary import instance
from experiments.objects.constructions import polygon
from experiments.objects.parts import extruded
from experiments.objects.shapes import sample
from experiments.studies.boundary import CLEAN, NOISY, View, shown
from symrefine.detection.story import detect
from symrefine.geometry import Axis, Isometry, householder, random_orthogonal, rotation
from symrefine.shape import Shape
from symrefine.surface.skin import Skin, make_skin
from symrefine.surface.wedge import Wedge

FOLD = 24


def teeth(lean: float, rng: np.random.Generator, count: int = 8000, noise: float = 0.0) -> np.ndarray:
    """Points [count, 3] of a wheel of `FOLD` waves whose crests lean: of a mirror image only where they do not."""
    angle, height = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(-0.4, 0.4, count)
    phase = FOLD * angle
    radius = 1.0 + 0.06 * (np.cos(phase) + lean * np.sin(2.0 * phase))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    return points + noise * rng.standard_normal(points.shape)


def wide(points: np.ndarray) -> Skin:
    """Their skin, with neighbourhoods that are as wide as a tooth."""
    return Skin(points=points, normals=None, neighbours=96)


def judged(points: np.ndarray, motions: list[Isometry], axis: Axis) -> np.ndarray:
    wedge = Wedge.of(wide(points), axis, FOLD)
    return wedge.needs(motions, float(np.linalg.norm(np.ptp(points, axis=0))), open_=False)


@pytest.mark.parametrize("det", [1, -1])
def test_operations_of_the_object_need_nothing_in_any_pose_and_others_what_they_miss(det):
    rng = np.random.default_rng(7)
    pose, shift = random_orthogonal(rng, 3, det), rng.standard_normal(3)
    z = np.array([0.0, 0.0, 1.0])
    true = [rotation(z, 2.0 * np.pi / FOLD), householder([0.0, 1.0, 0.0]), householder(z), -np.eye(3)]
    false = [rotation(z, np.pi / FOLD), householder([np.sin(0.5 * np.pi / FOLD), np.cos(0.5 * np.pi / FOLD), 0.0])]
    motions = [Isometry.about(shift, pose @ m @ pose.T) for m in (*true, *false)]
    points = teeth(0.0, rng, noise=0.003) @ pose.T + shift
    needs = judged(points, motions, Axis(direction=pose[:, 2], point=shift))
    assert needs[: len(true)].max() < 0.25 * needs[len(true) :].min()
    assert needs[len(true) :].min() > 0.02


def test_crests_that_lean_deny_the_mirror_and_not_the_turns():
    rng = np.random.default_rng(8)
    z, axis = np.array([0.0, 0.0, 1.0]), Axis(direction=np.array([0.0, 0.0, 1.0]), point=np.zeros(3))
    motions = [Isometry.about(np.zeros(3), m) for m in (householder([0.0, 1.0, 0.0]), rotation(z, 2.0 * np.pi / FOLD))]
    upright, leaning = (judged(teeth(lean, rng, noise=0.003), motions, axis) for lean in (0.0, 0.7))
    assert leaning[0] > 3.0 * max(upright[0], 1e-3)
    assert leaning[1] == upright[1] == 0.0


def test_what_does_not_keep_the_axis_is_not_told_nor_what_turns_an_open_surface_over():
    rng = np.random.default_rng(9)
    points = teeth(0.9, rng)
    wedge = Wedge.of(wide(points), Axis(direction=np.array([0.0, 0.0, 1.0]), point=np.zeros(3)), FOLD)
    aside = Isometry.about(np.zeros(3), householder([1.0, 0.0, 1.0]))
    over = Isometry.about(np.array([0.0, 0.0, 0.3]), householder([0.0, 0.0, 1.0]))
    told = wedge.needs([aside, over], 3.0, open_=False)
    assert told[0] == 0.0
    assert told[1] > 0.1
    assert wedge.needs([aside, over], 3.0, open_=True).tolist() == [0.0, 0.0]


def test_a_surface_that_neighbourhoods_resolve_is_not_folded():
    rng = np.random.default_rng(10)
    points = teeth(0.0, rng, count=20000)
    axis = Axis(direction=np.array([0.0, 0.0, 1.0]), point=np.zeros(3))
    assert Wedge.is_needless(make_skin(points, rng), axis, 4)
    assert Wedge.is_needless(Skin(points=points, normals=points, neighbours=1), axis, FOLD)


@pytest.mark.parametrize(
    ("family", "name", "view"),
    [
        pytest.param("rotors", "fan23", NOISY, marks=pytest.mark.slow),
        ("rotors", "ratchet16", NOISY),
        pytest.param("rotors", "turbine60", View(form="cloud", points=20000, tolerance=0.004), marks=pytest.mark.slow),
        pytest.param("rotors", "impeller48", CLEAN, marks=pytest.mark.slow),
        pytest.param("rotors", "propeller41", CLEAN, marks=pytest.mark.slow),
    ],
)
def test_a_rotor_whose_blades_noise_blurs_is_not_told_for_sure_as_its_mirror_image(family, name, view):
    made = instance(family, name, 31)
    shape, _ = shown(made.shape, view, np.random.default_rng([31, FOLD]))
    found = detect(shape, tolerance=view.tolerance)
    truth = made.truth.group
    if found.undetermined or found.group.is_chiral:
        assert found.undetermined or found.point_group in (truth.name, "C1")
    else:
        assert max(a.probability for a in found.examined.choices(view.tolerance)) < 0.95


def test_teeth_that_neighbourhoods_blur_are_counted():
    made = instance("gears", "spur32", 31)
    shape, _ = shown(made.shape, NOISY, np.random.default_rng([31, 1]))
    assert detect(shape).point_group == "D32h"


@pytest.mark.parametrize("seed", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1))])
def test_few_noisy_points_of_a_prism_keep_its_group(seed):
    part = extruded(polygon(8), -0.4, 0.4)
    rng = np.random.default_rng(30 + seed)
    prism = Shape(part.vertices, part.faces)
    cloud = sample(prism, 1500, 0.01, rng)
    assert detect(cloud).point_group == "D8h"
