"""Fits a curve and two half moons, and draws both: python examples/quickstart.py [picture.png]"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from sklearn.datasets import make_moons

from elm_learn import ElmClassifier, ElmRegressor

rng = np.random.default_rng(0)
X = np.sort(rng.uniform(-10, 10, 150))[:, None]
y = np.sinc(X[:, 0] / np.pi) + 0.1 * rng.normal(size=150)
model = ElmRegressor(50, scale="loo", intervals=True, random_state=0).fit(X, y)
grid = np.linspace(-12, 12, 500)[:, None]
low, high = model.predict_interval(grid, alpha=0.1)

moons, side = make_moons(300, noise=0.25, random_state=0)
classifier = ElmClassifier(random_state=0).fit(moons, side)
a, b = np.meshgrid(np.linspace(-2, 3, 200), np.linspace(-1.5, 2, 200))
p = classifier.predict_proba(np.c_[a.ravel(), b.ravel()])[:, 1].reshape(a.shape)

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
left.fill_between(grid[:, 0], low, high, alpha=0.3, label="90 % of new observations")
left.plot(grid[:, 0], model.predict(grid), label="prediction")
left.plot(X[:, 0], y, ".", color="0.3", label="data")
left.legend()
left.set_title(f"R2 of rows left out: {model.loo_score_:.3f}")
right.contourf(a, b, p, levels=11, cmap="RdBu", alpha=0.7)
right.scatter(*moons.T, c=side, cmap="RdBu", edgecolor="k", s=15)
right.set_title("probability of the second class")
path = sys.argv[1] if len(sys.argv) > 1 else "quickstart.png"
figure.savefig(path, dpi=120, bbox_inches="tight")
print("wrote", path)
