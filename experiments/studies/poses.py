"""Poses that do not flip, and distances beside those of BOP's definition.

    python -m experiments.studies.poses [--frames N] [--step-deg D] [--noise-deg D] [--pairs N] [--seed N]

A body of each group wanders for 1,000 frames, its centre beside its origin. Each frame is noisy, and shows the body in
one of its equivalents, drawn at random. A flip is a step between two frames that is longer than it was before the
equivalents were drawn: of the poses as they come, of those nearest to one fixed reference, and of the sequence.

Then MSSD of pairs of poses of a lathed body (20,480 vertices), beside the least of 315 turns about its axis, as
`bop_toolkit` evaluates: by how much that is above the exact value, and the time of the processor that both take.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time

import numpy as np
from scipy.spatial.transform import Rotation

from symrefine.geometry import Array, random_orthogonal
from symrefine.groups import PointGroup, point_group
from symrefine.groups.orthogonal import chord_angles
from symrefine.poses.canonicalizer import Canonicalizer
from symrefine.poses.distance import symmetric_distance
from symrefine.poses.symmetry import homogeneous

GROUPS = ("C2", "C3", "C5", "D2", "D4", "D6", "T", "O", "I", "Cinf", "Dinf")
# Angles [rad] that differ by less do so by rounding.
ROUNDING = 1e-6
# Turns and rings of the lathed body, and the turns that BOP looks at: pi over a step of 0.01 diameters.
SECTORS, RINGS = 128, 160
BOP_TURNS = 315
# Errors of poses, as rotation [rad] and as a share of the size.
ERRORS = (1e-3, 1e-2, 1e-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """What became of a motion: the longest steps [deg], and flips among the steps.

    Attributes:
        group: of the body.
        seen_deg: longest step of the noisy motion itself.
        mixed_flips: of the poses as they come.
        fixed_flips: of those nearest to a fixed reference.
        flips: of the sequence.
        step_deg: longest step of the sequence.
        off_deg: how far the sequence is from the noisy motion in one of its equivalents, at the worst; NaN about a
            continuous axis, where nothing says how far the body has turned.
        frame_us: microseconds of the processor a frame.
    """

    group: str
    seen_deg: float
    mixed_flips: int
    fixed_flips: int
    flips: int
    step_deg: float
    off_deg: float
    frame_us: float


def motion(rng: np.random.Generator, frames: int, step_rad: float) -> Array:
    """Poses [frames, 4, 4] of a body that turns about a wandering axis, by a fifth of a step to a whole one a frame."""
    axes = np.cumsum(rng.standard_normal((frames, 3)), axis=0)
    lengths = step_rad * rng.uniform(0.2, 1.0, (frames, 1))
    turns = Rotation.from_rotvec(axes * lengths / np.linalg.norm(axes, axis=1, keepdims=True))
    found = np.tile(np.eye(4), (frames, 1, 1))
    found[0, :3, :3] = random_orthogonal(rng)
    for before, turn, after in zip(found[:-1], turns.as_matrix()[1:], found[1:], strict=True):
        after[:3, :3] = turn @ before[:3, :3]
    found[:, :3, 3] = np.cumsum(rng.normal(scale=0.01, size=(frames, 3)), axis=0) + [0.0, 0.0, 5.0]
    return found


def draws(group: PointGroup, center: Array, count: int, rng: np.random.Generator) -> Array:
    """Operations [count, 4, 4] of a group of rotations, drawn at random: of a continuous one, any."""
    if group.is_finite:
        return homogeneous(rng.choice(group.operations(), count), center)
    turns = Rotation.from_quat(rng.standard_normal((count, 4))).as_matrix()
    return homogeneous(group.nearest(turns), center)


def track(name: str, *, frames: int, step_rad: float, noise_rad: float, seed: int) -> Tracked:
    """One group."""
    rng = np.random.default_rng([seed, *name.encode()])
    group, center = point_group(name, random_orthogonal(rng)), rng.uniform(-1.0, 1.0, 3)
    noise = Rotation.from_rotvec(rng.normal(scale=noise_rad / np.sqrt(3.0), size=(frames, 3))).as_matrix()
    seen = motion(rng, frames, step_rad) @ homogeneous(noise, np.zeros(3))
    mixed = seen @ draws(group, center, frames, rng)
    canonical = Canonicalizer(group, center=center)
    start = process_time()
    found = canonical.sequence(mixed)
    seconds = process_time() - start
    limit = steps(seen) + ROUNDING
    off = chord_angles(found[:, :3, :3], seen[:, :3, :3] @ seen[0, :3, :3].T @ found[0, :3, :3])
    return Tracked(
        group=name,
        seen_deg=float(np.degrees(steps(seen).max())),
        mixed_flips=int((steps(mixed) > limit).sum()),
        fixed_flips=int((steps(canonical(mixed)) > limit).sum()),
        flips=int((steps(found) > limit).sum()),
        step_deg=float(np.degrees(steps(found).max())),
        off_deg=float(np.degrees(off.max())) if group.is_finite else np.nan,
        frame_us=1e6 * seconds / frames,
    )


def steps(poses: Array) -> Array:
    """Angles [T - 1] between each pose and the next [rad]."""
    return chord_angles(poses[1:, :3, :3], poses[:-1, :3, :3])


def lathed() -> Array:
    """Vertices [SECTORS RINGS, 3] of a vase about z, without a mirror across."""
    t, z = 2.0 * np.pi * np.arange(SECTORS) / SECTORS, np.linspace(-1.5, 1.5, RINGS)
    radius = 1.0 + 0.3 * np.sin(1.0 + 2.0 * z)
    rings = radius[:, None, None] * np.stack([np.cos(t), np.sin(t)], axis=-1)
    return np.concatenate([rings, np.broadcast_to(z[:, None, None], (RINGS, SECTORS, 1))], axis=-1).reshape(-1, 3)


def bop_mssd(a: Array, b: Array, vertices: Array) -> float:
    """The least largest distance of vertices [V, 3] in poses a and b S [4, 4], of 315 turns S about z."""
    turns = Rotation.from_rotvec(2.0 * np.pi * np.outer(np.arange(BOP_TURNS) / BOP_TURNS, [0.0, 0.0, 1.0])).as_matrix()
    there = vertices @ a[:3, :3].T + a[:3, 3]
    return min(float(np.linalg.norm(there - vertices @ (b[:3, :3] @ s).T - b[:3, 3], axis=1).max()) for s in turns)


def distances(pairs: int, seed: int) -> Iterator[str]:
    """The second table, as lines."""
    vertices = lathed()
    size = float(np.ptp(vertices, axis=0).max())
    yield "error of the pose  MSSD / size  above it, BOP's turns: mean %  most %   ms a pair  BOP's ms a pair"
    for error in ERRORS:
        rng = np.random.default_rng([seed, int(1.0 / error)])
        true, small = (np.tile(np.eye(4), (pairs, 1, 1)) for _ in range(2))
        true[:, :3, :3] = Rotation.from_quat(rng.standard_normal((pairs, 4))).as_matrix()
        small[:, :3, :3] = Rotation.from_rotvec(error * rng.standard_normal((pairs, 3))).as_matrix()
        small[:, :3, 3] = error * size * rng.standard_normal((pairs, 3))
        estimate = true @ small @ draws(point_group("Cinf"), np.zeros(3), pairs, rng)
        start = process_time()
        exact = symmetric_distance(estimate, true, "Cinf", points=vertices).mssd
        middle = process_time()
        sampled = np.array([bop_mssd(a, b, vertices) for a, b in zip(estimate, true, strict=True)])
        end = process_time()
        above = 100.0 * (sampled / exact - 1.0)
        yield (
            f"{error:17g}  {np.mean(exact) / size:11.4f}  {above.mean():32.2f}  {above.max():6.2f}  "
            f"{1e3 * (middle - start) / pairs:10.2f}  {1e3 * (end - middle) / pairs:15.2f}"
        )


def main(arguments: list[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.poses",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--frames", type=int, default=1000, help="of each motion (default: %(default)s)")
    parser.add_argument("--step-deg", type=float, default=5.0, help="longest true step (default: %(default)s)")
    parser.add_argument("--noise-deg", type=float, default=2.0, help="RMS angle of the noise (default: %(default)s)")
    parser.add_argument("--pairs", type=int, default=50, help="of poses for MSSD (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of motions, noise and draws (default: %(default)s)")
    options = parser.parse_args(arguments)
    if min(options.frames, options.pairs) < 2:
        parser.error("--frames and --pairs must be 2 or more")
    print(
        f"{options.frames:,} frames of each group: steps that flip, as they come, by a fixed reference, as a sequence"
    )
    print("group  longest step deg  flips: as they come  fixed  sequence  longest step deg  off deg  us a frame")
    for name in GROUPS:
        given = {"step_rad": np.radians(options.step_deg), "noise_rad": np.radians(options.noise_deg)}
        r = track(name, frames=options.frames, seed=options.seed, **given)
        print(
            f"{r.group:5s}  {r.seen_deg:16.2f}  {r.mixed_flips:19d}  {r.fixed_flips:5d}  {r.flips:8d}  "
            f"{r.step_deg:16.2f}  {r.off_deg:7.1e}  {r.frame_us:10.2f}"
        )
    print(f"\nMSSD of {options.pairs} pairs, a lathed body of {SECTORS * RINGS:,} vertices")
    for line in distances(options.pairs, options.seed):
        print(line, flush=True)


if __name__ == "__main__":
    main()
