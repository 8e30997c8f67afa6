# %% [markdown]
# # From a depth image to a grasp
#
# A robot sees a bolt from one side. By which motions does it come to look the same? Pose estimation needs to know (the
# BOP format has a field for it), and it makes one good grasp into many.
#
# Everything here runs from nothing: the depth image is made first.

# %%
import json
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import symrefine

folder = tempfile.TemporaryDirectory()  # files are written there
os.chdir(folder.name)

# %% [markdown]
# ## A depth image
#
# The bolt has a hexagonal head and a round shank, 60 mm long in all. It lies a quarter of a metre in front of a pinhole
# camera. Depths are in metres, 0 where nothing was measured.

# %%
shank = trimesh.creation.cylinder(radius=0.010, height=0.045, sections=96)
shank.apply_translation([0, 0, 0.0225])
head = trimesh.creation.cylinder(radius=0.020, height=0.015, sections=6)
head.apply_translation([0, 0, 0.0525])
bolt = trimesh.util.concatenate([shank, head])

pose = trimesh.transformations.euler_matrix(0.9, 0.5, 0.2)
pose[:3, 3] = [0.0, 0.0, 0.25] - pose[:3, :3] @ [0, 0, 0.03]
intrinsics = fx, fy, cx, cy = 615.0, 615.0, 160.0, 120.0


def depth_image():
    """What the camera sees, [240, 320]: the nearest triangle on the ray through each pixel, 0 for none."""
    column, row = np.meshgrid(np.arange(320), np.arange(240))
    rays = np.stack([(column - cx) / fx, (row - cy) / fy, np.ones(row.shape)], axis=-1)
    image = np.full(row.shape, np.inf)
    for corners in trimesh.transform_points(bolt.vertices, pose)[bolt.faces]:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = corners[0] @ normal / (rays @ normal)
        inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
        inside = (depth[..., None] * (rays @ inward.T) >= (corners * inward).sum(axis=1)).all(axis=-1)
        image = np.where(inside, np.minimum(image, depth), image)
    return np.where(np.isfinite(image), image, 0.0)


depth = depth_image()
np.save("depth.npy", depth)
plt.figure(figsize=(5, 3.2))
plt.imshow(np.where(depth > 0, depth, np.nan), cmap="viridis")
plt.colorbar(label="metres")
plt.axis("off")
plt.show()

# %% [markdown]
# ## What symmetry does it have?
#
# `load_depth` turns pixels into points and remembers where the camera stood. So free space speaks too: what the camera
# saw to be empty contradicts a symmetry, what lay hidden does not. The answer says "at least", since there may be more
# that this look does not show.

# %%
scan = symrefine.load_depth("depth.npy", intrinsics)
found = symrefine.detect(scan)

least = "at least " if found.at_least else ""
print(f"{len(scan.points):,} points: {least}{found.point_group}, confidence {found.confidence:.2f}")
for axis in found.axes:
    seen = axis.coverage
    print(f"axis of order {axis.order}: {seen.supported:.0%} supported, {seen.contradicted:.1%} contradicted,", end=" ")
    print(f"{seen.unseen:.0%} with an image where nobody looked")
found.plot()
plt.show()

# %% [markdown]
# The truth is known here, because we placed the bolt.

# %%
true_axis = pose[:3, 2]
main = max(found.axes, key=lambda a: a.order)
angle = np.degrees(np.arccos(min(1.0, abs(main.axis.direction @ true_axis))))
print(f"order {main.order}, {angle:.2f} degrees from the true axis")
assert main.order == 6
assert angle < 1.0

# %% [markdown]
# ## The side that nobody saw
#
# The images of the points under the symmetry, where the camera could not look:

# %%
whole = symrefine.complete(scan)
seen, inferred = whole.points[~whole.inferred], whole.points[whole.inferred]
print(f"{len(seen):,} points seen, {len(inferred):,} inferred, {whole.contradicted} contradicted")

figure = plt.figure(figsize=(9, 4))
for place, (elev, azim) in enumerate([(-60, -90), (-60, 90)], start=1):
    axes = figure.add_subplot(1, 2, place, projection="3d")
    axes.scatter(*seen[::3].T, s=1, color="#8a94a6", label="seen")
    axes.scatter(*inferred[::3].T, s=1, color="#74be60", label="inferred")
    axes.set_box_aspect(np.ptp(whole.points, axis=0))
    axes.view_init(elev=elev, azim=azim + 60)
    axes.set_axis_off()
axes.legend(markerscale=6, loc="upper right")
plt.show()

# %% [markdown]
# ## For pose estimation: BOP
#
# The BOP benchmark keeps symmetries in `models_info.json`, in millimetres and in the frame of the model. The mesh,
# taken as trimesh holds it, is in metres, so one unit is 1000 mm. Mirrors are left out: no rigid motion does
# what they do.

# %%
package = symrefine.export(bolt, "bop", "models_info.json", scale=1000.0)
print(*package.notes, sep="\n")

entry = json.loads(Path("models_info.json").read_text())["1"]
print("diameter", round(entry["diameter"], 2), "mm,", len(entry["symmetries_discrete"]), "discrete symmetries")
print(np.array(entry["symmetries_discrete"][0]).reshape(4, 4).round(3))
assert len(entry["symmetries_discrete"]) == 5

# %% [markdown]
# ## A grasp, and all that are as good
#
# The gripper comes from the side, across the main axis, and closes around the shank. One grasp gives one for each
# rotation of the group. The robot takes the one that turns its hand least.

# %%
axis, centre = main.axis.direction, found.center
approach = np.cross(axis, [0.0, 0.0, 1.0])
approach /= np.linalg.norm(approach)
grasp = np.column_stack([np.cross(approach, axis), axis, approach])  # closing, along the axis, approach

operations = found.operations()  # [N, 4, 4]
grasps = np.asarray(operations)[operations.determinants > 0, :3, :3] @ grasp
hand = np.diag([1.0, -1.0, -1.0])  # looking down
turns = np.degrees(np.arccos(np.clip((np.einsum("nij,ij->n", grasps, hand) - 1) / 2, -1, 1)))
print(f"{len(grasps)} grasps around", centre.round(4), "- turns of the hand in degrees:", turns.round(0))
print("take number", int(turns.argmin()))

# %% [markdown]
# ## A track that does not flip
#
# The bolt moves on, and a pose estimator follows it: where it stands now, seen from where it was scanned. In each frame
# the estimator reports one of six poses that look the same, whichever it likes. `Canonicalizer` takes the one nearest
# to the frame before, and the motion is back.

# %%
rng = np.random.default_rng(0)
frames = 200
turn_about = trimesh.transformations.rotation_matrix
true = np.array([turn_about(angle, [1, 2, 0], centre) for angle in np.linspace(0, 4, frames)])
proper = np.asarray(operations)[operations.determinants > 0]
reported = true @ rng.choice(proper, frames)

canonical = symrefine.Canonicalizer(found)
steady = canonical.sequence(reported)


def steps(poses):
    """By how many degrees each pose is turned from the one before."""
    turns = np.einsum("tji,tjk->tik", poses[:-1, :3, :3], poses[1:, :3, :3])
    return np.degrees(np.arccos(np.clip((np.trace(turns, axis1=1, axis2=2) - 1) / 2, -1, 1)))


plt.figure(figsize=(7, 3))
plt.plot(steps(reported), ".", color="#c0603f", label="as reported")
plt.plot(steps(steady), color="#2f6db5", label="nearest to the frame before")
plt.xlabel("frame")
plt.ylabel("degrees from the frame before")
plt.legend()
plt.show()
assert steps(steady).max() < 2.0

# %% [markdown]
# Errors and means are modulo the symmetry as well. MSSD, as the BOP benchmark has it, is the distance by which the
# worst vertex is off, for the equivalent that fits best.

# %%
noise = np.array([turn_about(0.01, axis, centre) for axis in rng.standard_normal((frames, 3))])
apart = symrefine.symmetric_distance(reported @ noise, true, canonical, points=scan.points)
print(f"off by {np.degrees(apart.angle_rad.max()):.2f} degrees at the most, MSSD {1000 * apart.mssd.max():.2f} mm")

still = canonical.mean(true[0] @ rng.choice(proper, frames) @ noise)
print(f"mean of {frames} reports of a bolt at rest: off by", end=" ")
print(f"{np.degrees(symrefine.symmetric_distance(still.pose, true[0], canonical).angle_rad):.3f} degrees")
assert not still.ambiguous
