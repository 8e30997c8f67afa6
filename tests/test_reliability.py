"""The pure parts of the reliability experiment: what is right, how it is counted, what is drawn, what is fitted."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from experiments.objects import built_symmetry
from experiments.objects.built_symmetry import Claim, Truth
from experiments.objects.poses import Pose
from experiments.studies import calibration, reliability
from experiments.studies.answers import SURE, all_there, fitted
from experiments.studies.boundary import HALVES, Case
from experiments.studies.calibration import Judged
from experiments.studies.reliability import Answer, Known
from symrefine.decide.posterior import Link, meant
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal, rotation
from symrefine.groups import PointGroup
from symrefine.moments.quadrature import sample_surface
from symrefine.surface.misses import TOLERANCE

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


def row(sure, right, look="a"):
    return Judged(look=look, confidence=sure, right=right)


def answer(sure, right, *, family="shape", name="table", view=0):
    case = Case(family=family, name=name, view=view)
    group = "undetermined" if math.isnan(sure) else "C4v" if right else "C2v"
    return Answer(case=case, truth="C4v", group=group, confidence=sure, right=right, elements=(), chain=())


@pytest.fixture(scope="module")
def stool():
    return reliability.answered(Case(family="shape", name="stool3", view=1))


@pytest.fixture(scope="module")
def found(stool):
    return detect(reliability.look(stool.case)[0])


def test_bins_hold_their_lower_edge_and_the_last_one_both():
    rows = [row(s, r) for s, r in ((0.0, False), (0.5, True), (0.6, False), (0.95, True), (1.0, True))]
    found = calibration.bins(rows, (0.0, 0.5, 0.95, 1.0))
    assert [(b.low, b.count) for b in found] == [(0.0, 1), (0.5, 2), (0.95, 2)]
    assert found[1].sure == pytest.approx(0.55)
    assert found[1].right == 0.5


def test_a_bin_counts_statements_and_looks():
    rows = [row(0.96, True)] * 9 + [row(0.96, False, "b")]
    (found,) = calibration.bins(rows)
    assert (found.count, found.looks) == (10, 2)
    assert found.right == pytest.approx(0.9)
    assert found.right_each == pytest.approx(0.5)


def test_the_summary_counts_statements_and_looks():
    rows = [row(0.99, True)] * 8 + [row(0.99, False, "b")] * 2 + [row(0.1, False)] * 8 + [row(0.1, True)] * 2
    found = calibration.summary(rows)
    assert (found.count, found.sure) == (20, 10)
    assert found.right == pytest.approx(0.5)
    assert found.sure_right == pytest.approx(0.8)
    assert found.sure_right_each == pytest.approx(0.5)  # one look all right, one all wrong
    assert found.right_sure == pytest.approx(0.8)
    assert found.brier == pytest.approx((8 * 0.01**2 + 2 * 0.99**2 + 8 * 0.1**2 + 2 * 0.9**2) / 20)
    assert found.gap == pytest.approx((10 * (0.99 - 0.8) + 10 * (0.2 - 0.1)) / 20)


def test_the_interval_of_a_share():
    # Wilson's interval for 9 of 10, as tabulated by Brown, Cai, DasGupta (2001).
    assert calibration.plausible(0.9, 10) == pytest.approx((0.5958, 0.9821), abs=1e-4)


def test_no_rows_make_no_figures():
    assert calibration.bins([]) == []
    assert math.isnan(calibration.summary([]).sure_right)


def test_the_plot_is_the_same_twice(tmp_path):
    rows = [row(s, s > 0.4, s) for s in np.linspace(0.0, 1.0, 101)]
    for name in ("a.png", "b.png"):
        calibration.plot(rows, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_half_of_the_objects_are_held_out_with_their_siblings():
    assert 0.4 < np.mean([fitted(name) for names in reliability.objects().values() for name in names]) < 0.6
    names = reliability.objects()["shape"]
    rows = [answer(0.5, True, family=family, name=name) for family in ("shape", "sibling") for name in names]
    mixes = reliability.mixes(rows)
    assert {r.case.name for r in mixes[HALVES[0]]} == {name for name in names if fitted(name)}
    assert len(mixes[HALVES[0]]) + len(mixes[HALVES[1]]) == len(mixes["all"]) == len(mixes["mesh"]) == len(rows)
    assert len(mixes["sibling"]) == len(names)
    assert mixes["sparse"] == []


@pytest.mark.parametrize("every", [reliability.QUICK_EVERY, 50])
def test_the_plan_goes_through_all_families_and_views(every):
    looks = list(reliability.plan(every, 0))
    assert {c.family for c in looks} >= {"shape", "sibling", "household", "sparse", "blobs"}
    assert {c.view for c in looks} == set(range(4))
    assert len(looks) == len(set(looks))
    for case in looks:
        reliability.check(case)


def test_the_whole_plan_holds_every_look_once():
    looks = list(reliability.plan(1, 0))
    names = reliability.objects()
    assert len(looks) == len(set(looks)) == sum(len(names[f]) * len(reliability.VIEWS[f]) for f in names)


@pytest.mark.parametrize(("family", "name", "view"), [("sibling", "stool3", 3), ("sparse", "bolt4", 0)])
def test_a_look_is_the_same_twice_and_differs_by_seed(family, name, view):
    case = Case(family=family, name=name, view=view)
    first, again, other = (reliability.look(c)[0].points for c in (case, case, replace(case, seed=1)))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_an_answer_is_what_detect_says(stool, found):
    assert (stool.group, stool.confidence) == (found.point_group, found.confidence)
    assert (stool.truth, stool.right) == ("C3v", True)
    assert len(stool.elements) == len(found.planes) + len(found.axes) == 4
    assert all(e.right and 0.0 <= e.confidence <= 1.0 for e in stool.elements)


def test_a_chain_ends_with_the_first_group_that_the_object_has_not(stool):
    assert stool.chain[0].true
    assert all(k.true for k in stool.chain[:-1])
    needs = [k.need for k in stool.chain]
    assert needs == sorted(needs)
    assert "C3v" in [k.group for k in stool.chain if k.true]


def test_a_false_truth_makes_its_elements_wrong(stool, found):
    _, pose, made = reliability.look(stool.case)
    truth = made.truth.posed(pose)
    turned = PointGroup(name="C3v", frame=random_orthogonal(np.random.default_rng(1)))
    assert all_there(found, truth, found.diagonal)
    assert not all_there(found, Truth(group=turned, center=truth.center), found.diagonal)


def test_the_report_counts_what_is_undetermined_by_itself():
    rows = [answer(0.99, True)] * 3 + [answer(0.6, True), answer(math.nan, False), answer(0.97, False, view=1)]
    lines = list(reliability.report(rows))
    assert any(line.startswith("0.98 to 1.00        3") for line in lines)
    (told,) = [line.split() for line in lines if line.startswith("all ")]
    assert [float(x) for x in told[1:4]] == [6, 1, 80.0]  # looks, undetermined, right % of the other five
    assert [float(x) for x in told[5:]] == [4, 75.0, 75.0]  # sure, right of them, and right ones called so


def test_what_is_sure_and_wrong_is_named():
    rows = [answer(SURE, False, view=2), answer(0.94, False), answer(math.nan, False), answer(0.99, True)]
    assert list(reliability.sure_and_wrong(rows)) == [
        "sure and wrong: shape table (20000 points, noise 0.5 %), seed 0: C4v -> C2v, confidence 0.950"
    ]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"family": "shapes", "name": "table"}, "family: value is 'shapes'"),
        ({"family": "shape", "name": "tabel"}, "name: value is 'tabel'"),
        ({"family": "shape", "name": "table", "view": 4}, "view: value is 4, expected 0 to 3"),
        ({"family": "sparse", "name": "cone", "view": 3}, "view: value is 3, expected 0 to 2"),
        ({"family": "shape", "name": "table", "seed": -1}, "seed: value is -1"),
    ],
)
def test_impossible_cases_are_refused(fields, message):
    with pytest.raises(InputError, match=message):
        reliability.check(Case(**fields))


def test_a_row_tells_the_answer(stool, monkeypatch):
    monkeypatch.setattr(reliability, "answered", lambda _: stool)
    told = reliability.run(stool.case)
    assert (told["truth"], told["answer"], told["right"], told["undetermined"]) == ("C3v", "C3v", True, False)
    assert told["sure"] is (told["confidence"] >= SURE)
    assert told["sure_right"] is (True if told["sure"] else None)


def drawn(count, constants, rng):
    """Links whose truth was drawn from the posterior's curve with given constants."""
    even, even_mirror, steepness, unknown, blurred = constants
    for i in range(count):
        group, noise = ("Cs", "C2")[i % 2], float(rng.choice([0.0, 0.004, 0.01]))
        need = TOLERANCE * float(np.exp(rng.uniform(-2.0, 1.0)))
        blur = 1.0 + (blurred * noise / TOLERANCE) ** 2
        squares = blur * (need / (even_mirror if group == "Cs" else even)) ** 2 + (unknown * noise) ** 2
        less_steep = steepness / (1.0 + (noise / TOLERANCE) ** 2)
        true = rng.random() < 1.0 / (1.0 + (squares / TOLERANCE**2) ** (less_steep / 2.0))
        yield Known(
            half=HALVES[i % 3 % 2],
            family="shape",
            name="a",
            view=0,
            group=group,
            need=need,
            noise=noise,
            lone=group == "Cs",
            true=bool(true),
        )


def test_the_misfit_is_that_of_the_posterior():
    links = list(drawn(50, reliability.SHIPPED, np.random.default_rng(0)))
    chances = [meant(Link(need=k.need, lone_mirror=k.lone), TOLERANCE, k.noise) for k in links]
    expected = -np.mean([math.log(p if k.true else 1.0 - p) for k, p in zip(links, chances, strict=True)])
    assert reliability.misfit(reliability.SHIPPED, links) == pytest.approx(expected)


@pytest.mark.slow
def test_the_fit_finds_the_constants_that_made_the_links():
    constants = (0.5, 0.9, 5.0, 1.2, 1.5)
    links = list(drawn(20000, constants, np.random.default_rng(0)))
    found = reliability.best(links)
    assert found == pytest.approx(constants, rel=0.15)
    assert reliability.misfit(found, links) <= reliability.misfit(constants, links)


def test_kept_chains_are_fitted_without_a_second_run(tmp_path, capsys, monkeypatch):
    path = tmp_path / "chains"
    links = list(drawn(300, reliability.SHIPPED, np.random.default_rng(0)))
    reliability.keep(links, path)
    assert reliability.kept(path) == links
    monkeypatch.setattr(reliability, "answered", None)
    assert reliability.main(["--fit", "--chains", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines[:2]] == list(HALVES)
    assert lines[3].startswith("shipped")
    assert len(lines) == 6


@pytest.mark.parametrize("option", ["--figure", "--chains"])
def test_a_file_without_a_place_is_refused_before_any_work(tmp_path, capsys, option):
    assert reliability.main(["--quick", option, str(tmp_path / "missing" / "file")]) == 2
    assert "there is no directory" in capsys.readouterr().err
