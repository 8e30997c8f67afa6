"""Adapters of other packages: what they say, in our words; the absent one is named in one line."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from experiments.objects.exhibits import exhibit
from experiments.objects.poses import Pose, posed
from experiments.objects.shapes import asymmetric, sample
from experiments.peers.pymatgen_groups import point_group_pymatgen, schoenflies
from experiments.peers.registration import PEERS, fast_global, installed, register
from experiments.peers.trimesh_inertia import trimesh_symmetry
from experiments.studies import partial_alignment as study
from symrefine.errors import InputError
from symrefine.geometry import line_angle_rad, random_orthogonal
from symrefine.shape import Shape


def test_a_study_tells_success_and_who_is_not_there(monkeypatch, tmp_path):
    methods = ("align", "kiss", "open3d fgr")
    monkeypatch.setattr(study, "installed", lambda name: name != "kiss")
    right = {("full", "align"): True, ("overlap 50 %", "align"): False, ("full", "open3d fgr"): False}
    rows = [
        SimpleNamespace(
            case=study.Case(name="camera", condition=condition, det=1, seed=0, method=method),
            right=is_right, seconds=0.1,
        )
        for (condition, method), is_right in right.items()
    ]  # fmt: skip
    head, ours, absent, theirs, *_ = study.curves(rows, methods)
    assert head.split()[3:5] == ["100", "%"]
    assert ours.split() == ["align", "1.00", "0.00"]
    assert absent.split() == ["kiss", "not", "installed"]
    assert theirs.split() == ["open3d", "fgr", "0.00"]
    assert study.success(rows, "overlap", "align") == {1.0: 1.0, 0.5: 0.0}
    assert "not installed" in next(line for line in study.table(rows, methods) if line.startswith("full"))
    study.picture(rows, methods, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "kind"), [("table", "radial"), ("bell", "radial"), ("mug", "none"), ("camera", "none")]
)
def test_trimesh_sees_equal_moments_of_inertia(name, kind):
    pose = Pose.random(np.random.default_rng(5))
    found = trimesh_symmetry(posed(exhibit(name).mesh, pose))
    assert found.kind == kind
    if kind == "radial":
        assert line_angle_rad(found.axis, pose.turn[:, 2]) < 1e-6
    else:
        assert found.axis is None


def test_trimesh_does_not_mind_which_way_a_surface_faces():
    mesh = exhibit("bottle").mesh
    turned = Shape(points=mesh.points, faces=mesh.faces[:, ::-1], measure="surface")
    assert trimesh_symmetry(turned).kind == trimesh_symmetry(mesh).kind == "radial"


def test_trimesh_takes_no_clouds():
    with pytest.raises(InputError, match="trimesh's symmetry needs a mesh, this is a cloud"):
        trimesh_symmetry(Shape.of(exhibit("mug").mesh.points))


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("C1", "C1"), ("Cs", "Cs"), ("Ci", "Ci"), ("C2v", "C2v"), ("C3h", "C3h"), ("S4", "S4"), ("D3d", "D3d"),
        ("C*v", "Cinfv"), ("D*h", "Dinfh"), ("Td", "Td"), ("Oh", "Oh"), ("Ih", "Ih"), ("Kh", "Kh"),
    ],
)  # fmt: skip
def test_symbols_in_our_spelling(theirs, ours):
    assert schoenflies(theirs) == ours


def test_what_is_no_symbol_is_refused():
    with pytest.raises(InputError, match="'P21/c' is not a point group"):
        schoenflies("P21/c")


def pretend(monkeypatch, answer):
    """A pymatgen that notes what it is given and answers with a symbol."""
    given = {}

    def molecule(elements, points):
        given.update(elements=elements, points=points)
        return "molecule"

    def analyzer(molecule, *, tolerance):
        given.update(molecule=molecule, tolerance=tolerance)
        return SimpleNamespace(sch_symbol=answer)

    core, inner = ModuleType("pymatgen.core"), ModuleType("pymatgen.symmetry.analyzer")
    core.Molecule, inner.PointGroupAnalyzer = molecule, analyzer
    parents = {name: ModuleType(name) for name in ("pymatgen", "pymatgen.symmetry")}
    for name, module in {**parents, "pymatgen.core": core, "pymatgen.symmetry.analyzer": inner}.items():
        monkeypatch.setitem(sys.modules, name, module)
    return given


def test_pymatgen_gets_atoms_and_tolerance(monkeypatch):
    given = pretend(monkeypatch, "D*h")
    points = np.array([[0, 0, -1.16], [0, 0, 0], [0, 0, 1.16]])
    assert point_group_pymatgen(("O", "C", "O"), points, 0.1) == "Dinfh"
    assert given["elements"] == ["O", "C", "O"]
    assert (given["molecule"], given["tolerance"]) == ("molecule", 0.1)
    np.testing.assert_array_equal(given["points"], points)


def test_without_pymatgen_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymatgen", None)
    monkeypatch.setitem(sys.modules, "pymatgen.core", None)
    with pytest.raises(InputError, match=r"pymatgen is not installed \(pymatgen.*\); pip install pymatgen"):
        point_group_pymatgen(["H"], np.zeros((1, 3)), 0.1)


def test_the_real_pymatgen_where_it_is_installed():
    pytest.importorskip("pymatgen.symmetry.analyzer")
    oxygen, hydrogen = [0, 0, 0], [[0.76, 0, 0.59], [-0.76, 0, 0.59]]
    assert point_group_pymatgen(["O", "H", "H"], np.array([oxygen, *hydrogen]), 0.05) == "C2v"


# --- registration -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("det", [1, -1])
@pytest.mark.parametrize("name", [name for name in PEERS if installed(name)])
def test_registration_peers_are_asked_for_both_hands(name, det):
    rng = np.random.default_rng(1)
    mesh, matrix = asymmetric(), random_orthogonal(rng, det=det)
    source, target = (sample(mesh, 4000, 0.0, rng) for _ in range(2))
    found = register(name, source, target @ matrix.T + [1.0, 2.0, 3.0], mesh.diagonal)
    np.testing.assert_allclose(found[:3, :3], matrix, atol=0.2)  # without ICP, KISS-Matcher is 5 degrees off
    np.testing.assert_allclose(found[:3, 3], [1.0, 2.0, 3.0], atol=0.05 * mesh.diagonal)


def test_a_registration_peer_that_is_absent_is_named(monkeypatch):
    monkeypatch.setitem(PEERS, "nobody", ("nowhere_at_all", fast_global))
    assert not installed("nobody")
    with pytest.raises(InputError, match="nobody: nowhere_at_all is not installed"):
        register("nobody", np.eye(3), np.eye(3), 1.0)
