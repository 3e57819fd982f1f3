"""Memory of the process over 10,000 fits: python elm-python/benches/memory.py [fits]"""

import os
import sys

import numpy as np

from elm_learn import ElmClassifier, ElmRegressor


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


fits = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
rng = np.random.default_rng(0)
X = rng.normal(size=(200, 5))
y = X[:, 0] + rng.normal(size=200)
for fit in range(fits + 1):
    if fit % max(1, fits // 10) == 0:
        print(f"{fit} fits: {resident():.1f} MiB", flush=True)
    ElmRegressor(20, random_state=fit).fit(X, y).predict(X)
    if fit % 2 == 0:
        ElmClassifier(20, random_state=fit).fit(X, y > 0).predict_proba(X)
