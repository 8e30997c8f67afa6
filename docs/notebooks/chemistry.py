# %% [markdown]
# # A molecule, and a noisy one
#
# Atoms stand for themselves: each has to land on an atom of its own element. So there is no surface, no sampling, and
# the tolerance is all that decides how far a structure may be from its ideal.

# %%
import matplotlib.pyplot as plt
import numpy as np

import symrefine

# %% [markdown]
# ## Staggered ferrocene
#
# Iron between two five-rings of carbon, one turned by 36 degrees against the other. Lengths in angstroms.


# %%
def ring(element, radius, height, turn_deg):
    """Five atoms of a ring."""
    angle = np.radians(turn_deg + 72.0 * np.arange(5))
    return [(element, radius * np.cos(a), radius * np.sin(a), height) for a in angle]


atoms = [("Fe", 0.0, 0.0, 0.0)]
for side, turn in ((1, 0.0), (-1, 36.0)):
    atoms += ring("C", 1.215, side * 1.66, turn) + ring("H", 2.295, side * 1.66, turn)
elements = [a[0] for a in atoms]
positions = np.array([a[1:] for a in atoms])
labels = [{"Fe": 26, "C": 6, "H": 1}[e] for e in elements]

found = symrefine.detect(positions, labels=labels)
print(found.point_group, "with confidence", round(found.confidence, 3))
print(len(found.planes), "mirror planes, inversion:", found.inversion)
for axis in found.axes:
    kind = f"S{axis.order}" if axis.improper else f"C{axis.order}"
    print(f"  {kind:4s}", axis.axis.direction.round(3))
assert found.point_group == "D5d"
found.plot()
plt.show()

# %% [markdown]
# Labels are classes that no operation mixes. Make one carbon a nitrogen, and most of the symmetry is gone:

# %%
substituted = list(labels)
substituted[1] = 7
print(symrefine.detect(positions, labels=substituted).point_group)

# %% [markdown]
# ## With noise
#
# A structure from an experiment or a simulation misses its group by hundredths of an angstrom. The worst atom counts,
# and 2 % of the diagonal are 0.14 angstroms here. Where the miss comes near that, the confidence falls, and then the
# answer changes.

# %%
rng = np.random.default_rng(1)
noise = rng.normal(size=positions.shape)
sizes = np.array([0.0, 0.01, 0.02, 0.03, 0.035, 0.04, 0.045, 0.05, 0.06, 0.08])
answers = [symrefine.detect(positions + size * noise, labels=labels) for size in sizes]

print("noise  group  confidence  else it may be (to be forgiven, % of the diagonal)")
for size, answer in zip(sizes, answers, strict=True):
    others = ", ".join(
        f"{a.point_group} {100 * a.probability:.0f} % ({100 * a.forgiven:.1f})" for a in answer.alternatives
    )
    print(f"{size:.3f}  {answer.point_group:5s}  {answer.confidence:.2f}        {others}")

# %%
names = sorted({a.point_group for a in answers})
figure, axes = plt.subplots(figsize=(7, 3.2))
for name in names:
    chosen = [i for i, a in enumerate(answers) if a.point_group == name]
    axes.plot(sizes[chosen], [answers[i].confidence for i in chosen], "o", markersize=9, label=name)
axes.set(xlabel="noise of each coordinate, angstroms", ylabel="confidence", ylim=(0, 1.05))
axes.legend(title="answer", frameon=False)
axes.grid(alpha=0.3)
plt.show()

# %% [markdown]
# The tolerance is a choice. The group at others comes from the same table of misses:

# %%
answer = symrefine.detect(positions + 0.05 * noise, labels=labels, ladder=(0.005, 0.01, 0.02, 0.04))
for step in answer.staircase:
    print(f"{100 * step.tolerance:g} %: {step.point_group}")

# %% [markdown]
# ## The nearest exact structure
#
# `symmetrize` puts each atom at the mean of its orbit, under the group that is found at the tolerance of your choice.
# What comes out has that group to rounding.

# %%
noisy = positions + 0.05 * noise
made = symrefine.symmetrize(symrefine.Shape(noisy, labels=labels), tolerance=0.04)
print(f"{made.group.name} made exact, by {made.method}")

exact = made.shape.points
moved = np.linalg.norm(exact - noisy, axis=1)
print(f"atoms moved by {moved.mean():.3f} angstroms in the mean, {moved.max():.3f} at most")
again = symrefine.detect(exact, labels=labels)
worst = max(plane.residual.max for plane in again.planes)
print(f"{again.point_group}, largest miss {worst:.1e} of the diagonal")
assert again.point_group == "D5d"
assert worst < 1e-9
