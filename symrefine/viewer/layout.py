"""How a recording looks when it opens: the shape on the left, series and texts on the right."""

import math
from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from symrefine.detection.result import Detection
from symrefine.picture.camera import Camera, look_at
from symrefine.picture.palette import Colour
from symrefine.picture.scene import Scene

# The timeline that is scrubbed.
STORY = "story"
# Series of the refinement: entity under /series, title and colour.
SERIES: dict[str, tuple[str, Colour]] = {
    "turn_deg": ("turn of the frame [deg]", (255, 150, 60)),
    "cost": ("cost: mean squared residual", (86, 180, 233)),
    "inliers": ("pairs in agreement", (60, 200, 150)),
    "step": ("step [rad, RMS radii]", (220, 130, 190)),
}
# What the viewer's camera spans unless told otherwise, and the share of it that is filled.
FOV_RAD, FILL = math.radians(55.0), 0.78
BACKGROUND = (22, 25, 32)


def blueprint(detection: Detection, scene: Scene, scale: float) -> Any:
    """The layout; `scale` is that of the transform above all positions."""
    refined = len(detection.history) > 1
    views = [_view("Story", scene, scale, ["- /object/refinement/points", "- /object/refinement/pairs/**"])]
    if refined:
        without = (
            "cloud",
            "inferred",
            "contradicted",
            "outliers",
            "mesh",
            "planes/**",
            "ntuples",
            "near_misses/**",
            "candidates",
            "refinement/misses",
        )
        views.append(_view("Refinement", scene, scale, [f"- /object/{entity}" for entity in without]))
    report = rrb.TextDocumentView(origin="/report", name="Report")
    log = rrb.TextLogView(origin="/log", name="Log")
    right = rrb.Vertical(report, _series(), log, row_shares=[4, 4, 2]) if refined else rrb.Vertical(report, log)
    return framed(rrb.Tabs(*views, active_tab=0), right)


def framed(left: Any, right: Any) -> Any:
    """The layout with these beside one another, the story on its timeline, all panels folded away."""
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.TimePanel(timeline=STORY, fps=1.0, state="collapsed", play_state="following"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
    )


def _view(name: str, scene: Scene, scale: float, without: list[str]) -> Any:
    """A 3-D view from where the scene shows best; near misses, cameras, and planes that crowd it are off."""
    crowd = ("object/planes", "object/refinement/planes") if scene.crowded else ()
    hidden = ("object/near_misses", "object/cameras", *crowd)
    camera = look_at(scene, aspect=1.1, fov_rad=FOV_RAD, fill=FILL)
    return view3d(name, camera, scale, without=without, hidden=hidden)


def view3d(name: str, camera: Camera, scale: float, *, without: Sequence[str] = (), hidden: Sequence[str] = ()) -> Any:
    """A 3-D view of the object as a camera sees it.

    Args:
        scale: of the transform above all positions.
        without: rules that leave entities out.
        hidden: entities that are off until they are switched on.
    """
    return rrb.Spatial3DView(
        origin="/",
        name=name,
        contents=["+ /object/**", *without],
        overrides={entity: rrb.EntityBehavior(visible=False) for entity in hidden},
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=scale * camera.eye, look_target=scale * camera.target, eye_up=camera.up, kind=rrb.Eye3DKind.Orbital
        ),
    )


def _series() -> Any:
    """A tab for each series, and one for the planes' own angles."""
    hidden = rrb.PlotLegend(visible=False)
    views = [
        rrb.TimeSeriesView(origin=f"/series/{name}", name=title.split(":")[0], plot_legend=hidden)
        for name, (title, _) in SERIES.items()
    ]
    views.insert(1, rrb.TimeSeriesView(origin="/series/theta_deg", name="theta [deg]"))
    return rrb.Tabs(*views, active_tab=0)
