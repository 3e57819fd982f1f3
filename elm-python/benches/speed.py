"""Fit and predict beside other libraries, in turn in one process, as a table of medians (processor time on one thread).

    python elm-python/benches/speed.py [threads] [rows]

The others are scikit-learn's random features with a ridge tuned by leave-one-out, hpelm, scikit-elm (its module
is skelm) and gfdl, as far as they can be imported and do not fail.
"""

import os
import sys

THREADS = sys.argv[1] if len(sys.argv) > 1 else "1"
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = THREADS

import time
import warnings

import numpy as np
from sklearn.kernel_approximation import RBFSampler
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from elm_learn import ElmRegressor

warnings.filterwarnings("ignore")
# With one thread processor time, which other programs on the machine leave alone.
clock = time.process_time if THREADS == "1" else time.perf_counter
SIZES = [(2_000, 10), (20_000, 20), (100_000, 20)]
NEURONS = 200


class Hpelm:
    def fit(self, X, y):
        import hpelm

        self.model = hpelm.ELM(X.shape[1], 1)
        self.model.add_neurons(NEURONS, "tanh")
        self.model.train(X, y[:, None], "r")
        return self

    def predict(self, X):
        return self.model.predict(X)[:, 0]


def skelm():
    from skelm import ELMRegressor

    return ELMRegressor(n_neurons=NEURONS, ufunc="tanh")


def gfdl():
    from gfdl.model import GFDLRegressor

    return GFDLRegressor(hidden_layer_sizes=[NEURONS], activation="tanh", reg_alpha=1e-3)


METHODS = {
    "ElmRegressor(200)": lambda: ElmRegressor(NEURONS, random_state=0, n_jobs=int(THREADS)),
    "ElmRegressor(200, alpha=1e-6)": lambda: ElmRegressor(
        NEURONS, alpha=1e-6, random_state=0, n_jobs=int(THREADS)
    ),
    "RBFSampler + RidgeCV": lambda: make_pipeline(
        StandardScaler(), RBFSampler(n_components=NEURONS, random_state=0), RidgeCV()
    ),
    "hpelm": Hpelm,
    "scikit-elm": skelm,
    "gfdl": gfdl,
}


def main():
    print(f"{THREADS} thread(s), numpy {np.__version__}\n")
    print("| rows x inputs | method | fit, ms | predict, ms | both, ratio to ours |")
    print("|---|---|---|---|---|")
    only = [int(word) for word in sys.argv[2:]]
    for rows, inputs in SIZES:
        if only and rows not in only:
            continue
        rng = np.random.default_rng(0)
        X = rng.normal(size=(rows, inputs))
        y = np.sin(X[:, 0]) + X[:, 1] * X[:, 2] + 0.1 * rng.normal(size=rows)
        times, failed = {name: [] for name in METHODS}, {}
        for _ in range(7 if rows < 10_000 else 3):
            for name, make in METHODS.items():
                if name in failed:
                    continue
                try:
                    begin = clock()
                    model = make().fit(X, y)
                    middle = clock()
                    model.predict(X)
                    times[name].append((middle - begin, clock() - middle))
                except Exception as error:
                    failed[name] = f"{type(error).__name__}: {error}"[:60]
        ours = np.median(np.sum(times["ElmRegressor(200)"], axis=1))
        for name in METHODS:
            if name in failed:
                print(f"| {rows} x {inputs} | {name} | {failed[name]} | | |")
                continue
            fit, predict = 1e3 * np.median(times[name], axis=0)
            both = np.median(np.sum(times[name], axis=1)) / ours
            print(f"| {rows} x {inputs} | {name} | {fit:.1f} | {predict:.1f} | {both:.2f} |", flush=True)


if __name__ == "__main__":
    main()
