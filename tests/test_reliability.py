"""The pure parts of the reliability experiment: what is right, how it is counted, what is drawn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from experiments.objects import built_symmetry
from experiments.objects.built_symmetry import Claim, Truth
from experiments.objects.poses import Pose
from experiments.studies import reliability
from experiments.studies.reliability import Case, Judged
from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal, rotation
from symrefine.groups import PointGroup
from symrefine.moments.quadrature import sample_surface

DIAGONAL = 10.0


@pytest.fixture
def pose():
    return Pose.random(np.random.default_rng(5))


def claim_in(pose, kind, direction, order=1.0, tilt_deg=0.0, shift=(0.0, 0.0, 0.0)):
    """An element at a truth's centre, tilted about x + y + z and moved, then posed; the scale of the pose is undone."""
    turned = rotation([1, 1, 1], math.radians(tilt_deg)) @ np.asarray(direction, dtype=float)
    return Claim(kind=kind, order=order, direction=pose.turn @ turned, point=pose.of(np.asarray(shift) / pose.scale))


def truth_in(pose, name):
    return Truth(group=PointGroup(name=name), center=np.zeros(3)).posed(pose)


X, Z, DIAGONAL_XY = (1, 0, 0), (0, 0, 1), (math.sqrt(0.5), math.sqrt(0.5), 0)


@pytest.mark.parametrize(
    ("name", "kind", "direction", "order", "expected"),
    [
        ("C4v", "plane", X, 1, True),
        ("C4v", "plane", DIAGONAL_XY, 1, True),
        ("C4v", "plane", Z, 1, False),
        ("C4", "plane", X, 1, False),
        ("C4v", "axis", Z, 4, True),
        ("C4v", "axis", Z, 2, True),
        ("C4v", "axis", Z, 8, False),
        ("C4v", "axis", Z, 3, False),
        ("C4v", "axis", X, 2, False),
        ("C24v", "axis", Z, 25, False),
        ("C24v", "axis", Z, 12, True),
        ("C24v", "axis", Z, math.inf, False),
        ("Cinfv", "axis", Z, math.inf, True),
        ("Cinfv", "axis", Z, 7, True),
        ("Cinfv", "plane", X, 1, True),
        ("Cinfv", "plane", Z, 1, False),
        ("Dinfh", "plane", Z, 1, True),
        ("Dinfh", "axis", X, 2, True),
        ("Dinfh", "axis", X, 3, False),
        ("D2d", "improper", Z, 4, True),
        ("D4", "improper", Z, 4, False),
        ("D4h", "improper", Z, 4, True),
        ("D4h", "improper", Z, 8, False),
        ("C1", "plane", X, 1, False),
        ("Kh", "axis", X, math.inf, True),
    ],
)
def test_an_element_is_right_if_the_group_has_it(pose, name, kind, direction, order, expected):
    claim = claim_in(pose, kind, direction, order)
    assert built_symmetry.holds(truth_in(pose, name), claim, DIAGONAL) is expected
    flipped = replace(claim, direction=-claim.direction)
    assert built_symmetry.holds(truth_in(pose, name), flipped, DIAGONAL) is expected


@pytest.mark.parametrize(("kind", "order", "direction"), [("plane", 1, X), ("axis", 4, Z), ("axis", 2, Z)])
def test_it_is_right_up_to_three_degrees(pose, kind, order, direction):
    # A turn about x + y + z tilts a coordinate axis by less than its angle.
    def tilted(angle_deg):
        across = math.sqrt(2.0 / 3.0)
        turn_deg = math.degrees(2.0 * math.asin(math.sin(math.radians(angle_deg) / 2.0) / across))
        return claim_in(pose, kind, direction, order, tilt_deg=turn_deg)

    truth = truth_in(pose, "C4v")
    assert built_symmetry.holds(truth, tilted(2.9), DIAGONAL)
    assert not built_symmetry.holds(truth, tilted(3.1), DIAGONAL)


@pytest.mark.parametrize(
    ("kind", "order", "direction", "away", "along"),
    [("plane", 1, X, X, Z), ("axis", 4, Z, X, Z), ("improper", 4, Z, Z, None)],
)
def test_it_is_right_up_to_two_percent_of_the_diagonal(pose, kind, order, direction, away, along):
    truth = truth_in(pose, "D4h")

    def moved(step, where):
        return built_symmetry.holds(
            truth, claim_in(pose, kind, direction, order, shift=np.multiply(step, where)), DIAGONAL
        )

    assert moved(0.019 * DIAGONAL, away)
    assert not moved(0.021 * DIAGONAL, away)
    assert along is None or moved(DIAGONAL, along)  # a plane in itself, an axis along itself


@pytest.mark.parametrize(
    ("family", "name"),
    [("shape", "table"), ("sibling", "brick"), ("sibling", "bottle"), ("shape", "swirl6"), ("household", "mug"),
     ("household", "crown"), ("household", "bottle"), ("catalogue", "nut_pyvista"), ("catalogue", "quadknot")],
)  # fmt: skip
def test_every_operation_of_the_truth_maps_the_posed_object_onto_itself(pose, family, name):
    if name not in built_symmetry.names(family):
        pytest.skip("the catalogue is not there")
    mesh, truth = built_symmetry.specimen(family, name)
    truth = truth.posed(pose)
    points = pose.of(sample_surface(mesh, 30000, np.random.default_rng(0))[0])
    spacing = np.quantile(cKDTree(points[::2]).query(points[1::2])[0], 0.99)
    group = truth.group if truth.group.is_finite else truth.group.sampled(7)
    for matrix in group.operations():
        image = (points[::15] - truth.center) @ matrix.T + truth.center
        assert np.quantile(cKDTree(points).query(image)[0], 0.99) < 1.5 * spacing


def row(sure, right, *, name="a", claimed=True):
    return Judged(object=name, family="shape", view=0, kind="plane", claimed=claimed, confidence=sure, right=right)


def test_bins_hold_their_lower_edge_and_the_last_one_both():
    rows = [row(s, r) for s, r in ((0.0, False), (0.5, True), (0.6, False), (0.95, True), (1.0, True))]
    found = reliability.bins(rows, (0.0, 0.5, 0.95, 1.0))
    assert [(b.low, b.count) for b in found] == [(0.0, 1), (0.5, 2), (0.95, 2)]
    assert found[1].sure == pytest.approx(0.55)
    assert found[1].right == 0.5


def test_a_bin_counts_elements_and_detections():
    rows = [row(0.96, True)] * 9 + [row(0.96, False, name="b")]
    (found,) = reliability.bins(rows)
    assert (found.count, found.looks) == (10, 2)
    assert found.right == pytest.approx(0.9)
    assert found.right_each == pytest.approx(0.5)


def test_the_summary_counts_elements_and_objects():
    rows = [row(0.99, True)] * 8 + [row(0.99, False, name="b")] * 2 + [row(0.1, False)] * 10
    found = reliability.summary(rows)
    assert (found.count, found.sure) == (20, 10)
    assert found.sure_right == pytest.approx(0.8)
    assert found.sure_right_each == pytest.approx(0.5)  # one object all right, one all wrong
    assert found.brier == pytest.approx((8 * 0.01**2 + 2 * 0.99**2 + 10 * 0.1**2) / 20)
    assert found.gap == pytest.approx((10 * (0.99 - 0.8) + 10 * 0.1) / 20)


def test_half_of_the_objects_are_held_out_with_their_siblings():
    every = {name for family in built_symmetry.FAMILIES for name in built_symmetry.names(family)}
    assert 0.4 < np.mean([reliability.fitted(name) for name in every]) < 0.6
    rows = [row(0.5, True, name=name) for name in every]
    mixes = reliability.mixes(rows)
    assert {r.object for r in mixes["not fitted to"]} == {name for name in every if not reliability.fitted(name)}
    assert len(mixes["all"]) == len(mixes["shape"]) == len(rows)
    assert mixes["sibling"] == []


def test_the_interval_of_a_share():
    # Wilson's interval for 9 of 10, as tabulated by Brown, Cai, DasGupta (2001).
    assert reliability.plausible(0.9, 10) == pytest.approx((0.5958, 0.9821), abs=1e-4)


def test_no_rows_make_no_figures():
    assert reliability.bins([]) == []
    assert math.isnan(reliability.summary([]).sure_right)


def test_the_plan_goes_through_all_views():
    looks = list(reliability.plan(reliability.QUICK_EVERY, 0))
    assert {c.view for c in looks if c.family == "shape"} == set(range(len(reliability.VIEWS)))
    assert len(looks) == len(set(looks))
    assert len(list(reliability.plan(1, 0))) > 15 * len(looks)


def test_a_look_is_the_same_twice_and_differs_by_seed():
    case = Case(family="sibling", name="stool3", view=3)
    first, again, other = (reliability.look(c)[0].points for c in (case, case, replace(case, seed=1)))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_the_elements_of_a_detection_come_with_their_truth():
    rows = reliability.judged(Case(family="shape", name="stool3", view=1))
    assert [r.kind for r in rows if r.claimed] == ["plane"] * 3 + ["axis"]
    assert all(r.right for r in rows if r.claimed)
    assert all(0.0 <= r.confidence <= 1.0 for r in rows)


def test_a_false_truth_makes_its_elements_wrong():
    shape, truth = reliability.look(Case(family="shape", name="stool3", view=1))
    elsewhere = Truth(
        group=PointGroup(name="C3v", frame=random_orthogonal(np.random.default_rng(1))), center=truth.center
    )
    found = reliability.detect(shape)
    stated = [claim for claim, _, claimed in reliability.claims(found) if claimed]
    assert len(stated) == 4
    assert all(built_symmetry.holds(truth, claim, found.diagonal) for claim in stated)
    assert not any(built_symmetry.holds(elsewhere, claim, found.diagonal) for claim in stated)


def test_the_plot_is_the_same_twice(tmp_path):
    rows = [row(s, s > 0.4, claimed=s > 0.3) for s in np.linspace(0.0, 1.0, 101)]
    for name in ("a.png", "b.png"):
        reliability.plot(rows, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert any("0.95 to 1.00         6" in line for line in reliability.report(rows))


def test_what_is_sure_and_wrong_is_named():
    lines = list(reliability.sure_and_wrong([row(0.99, False), row(0.96, False), row(0.5, False), row(0.99, True)]))
    assert lines == ["sure and wrong: shape a (mesh): 2 of plane", ""]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"family": "shapes", "name": "table"}, "family: value is 'shapes'"),
        ({"family": "shape", "name": "tabel"}, "name: value is 'tabel'"),
        ({"family": "shape", "name": "table", "view": 4}, "view: value is 4, expected 0 to 3"),
        ({"family": "shape", "name": "table", "seed": -1}, "seed: value is -1"),
    ],
)
def test_impossible_cases_are_refused(fields, message):
    with pytest.raises(InputError, match=message):
        reliability.check(Case(**fields))


def test_a_row_counts_what_is_claimed():
    found = reliability.run(Case(family="shape", name="stool3", view=0))
    assert (found["claimed"], found["right"]) == (4, 4)
    assert found["sure_right"] == found["sure"] == 4
    assert found["sure_share"] == 1.0
    nothing = reliability.run(Case(family="shape", name="clutter", view=0))
    assert (nothing["claimed"], nothing["sure_share"]) == (0, None)


def test_a_plot_without_a_place_is_refused_before_any_work(tmp_path, capsys):
    assert reliability.main(["--quick", "--figure", str(tmp_path / "missing" / "plot.png")]) == 2
    assert "there is no directory" in capsys.readouterr().err
