"""What an ELM gives over random features + ridge, over kernel ridge and over an MLP: test error and
fit time on the toy problems, several seeds. Writes the table of elm/README.md.

    cargo build --release -p elm-learn --example csv
    pip install -r benches/peers/requirements.txt
    python3 benches/peers/choose.py [--rows 300,3000] [--seeds 5]

Each method is used as its user would: ours by `ElmParams::auto()`; the others with inputs (and, for
the MLP, targets) standardised and their settings by five-fold cross-validation over the grids below.
`fixed` is what an ELM is elsewhere: random features of the usual scale, nothing chosen but the
strength. Test errors are against the function without its noise. Times are CPU seconds of fitting
with everything that is searched, and of reading the table for ours; one thread.
"""

import argparse
import json
import os
import resource
import subprocess
import tempfile
import time
import warnings

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402
from sklearn.base import BaseEstimator, TransformerMixin  # noqa: E402
from sklearn.compose import TransformedTargetRegressor  # noqa: E402
from sklearn.exceptions import ConvergenceWarning  # noqa: E402
from sklearn.kernel_ridge import KernelRidge  # noqa: E402
from sklearn.linear_model import RidgeCV  # noqa: E402
from sklearn.model_selection import GridSearchCV  # noqa: E402
from sklearn.neural_network import MLPRegressor  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import StandardScaler  # noqa: E402

warnings.simplefilter("ignore", ConvergenceWarning)

HERE = os.path.dirname(os.path.abspath(__file__))
OURS = os.path.join(HERE, "../../target/release/examples/csv")


def circuit(x):
    low = np.array([0, 40 * np.pi, 0, 1])
    high = np.array([100, 560 * np.pi, 1, 11])
    a, b, c, d = (low + (high - low) * x).T
    return a, b * c - 1 / (b * d)


def friedman1(x):
    a, b, c, d, e = x.T[:5]
    return 10 * np.sin(np.pi * a * b) + 20 * (c - 0.5) ** 2 + 10 * d + 5 * e


# Inputs, the function of inputs from 0 to 1, and the noise: a third of the spread or what its
# author gave it.
PROBLEMS = {
    "sinc": (1, lambda x: np.sinc((20 * x[:, 0] - 10) / np.pi), 0.115),
    "Friedman 1": (10, friedman1, 1.0),
    "Friedman 2": (4, lambda x: np.hypot(*circuit(x)), 125.0),
    "Friedman 3": (4, lambda x: np.arctan2(circuit(x)[1], circuit(x)[0]), 0.1),
}


class RandomFeatures(TransformerMixin, BaseEstimator):
    def __init__(self, neurons=200, scale=1.0, seed=0):
        self.neurons, self.scale, self.seed = neurons, scale, seed

    def fit(self, x, y=None):
        random = np.random.default_rng(self.seed)
        self.weights = self.scale * random.uniform(-1, 1, (x.shape[1], self.neurons))
        self.biases = self.scale * random.uniform(-1, 1, self.neurons)
        return self

    def transform(self, x):
        return np.tanh(x @ self.weights + self.biases)


def methods(seed):
    strengths = np.logspace(-8, 2, 11)
    features = lambda: make_pipeline(  # noqa: E731
        StandardScaler(), RandomFeatures(seed=seed), RidgeCV(strengths)
    )
    mlp = MLPRegressor(hidden_layer_sizes=(64, 64), max_iter=1000, random_state=seed)
    return {
        "fixed": features(),
        "random features + ridge": GridSearchCV(
            features(),
            {
                "randomfeatures__scale": np.logspace(-1.5, 1.5, 7),
                "randomfeatures__neurons": [50, 200, 500],
            },
        ),
        "kernel ridge": GridSearchCV(
            make_pipeline(StandardScaler(), KernelRidge(kernel="rbf")),
            {
                "kernelridge__gamma": np.logspace(-3, 1, 9),
                "kernelridge__alpha": np.logspace(-5, 1, 7),
            },
        ),
        "MLP": GridSearchCV(
            make_pipeline(
                StandardScaler(),
                TransformedTargetRegressor(mlp, transformer=StandardScaler()),
            ),
            {"transformedtargetregressor__regressor__alpha": [1e-4, 1e-2, 1.0]},
        ),
    }


def rmse(a, b):
    return float(np.sqrt(np.mean((a - b) ** 2)))


def ours(folder, train, test):
    files = []
    for name, (x, y) in (("train", train), ("test", test)):
        path = os.path.join(folder, f"{name}.csv")
        header = ",".join([*(f"x{k}" for k in range(x.shape[1])), "y"])
        np.savetxt(path, np.column_stack([x, y]), "%.17g", ",", header=header, comments="")
        files.append(path)
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])  # noqa: E731
    before = used()
    found = subprocess.run(
        [OURS, *files, "--target", "y"], check=True, capture_output=True, text=True
    )
    return json.loads(found.stdout)["test_rmse"], used() - before


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", default="300,3000")
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    names = ["ELM, auto", *methods(0)]
    print("| problem, rows | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 1) + "|")
    for rows in map(int, arguments.rows.split(",")):
        for problem, (inputs, function, noise) in PROBLEMS.items():
            errors = {name: [] for name in names}
            times = {name: [] for name in names}
            for seed in range(arguments.seeds):
                random = np.random.default_rng(seed)
                x = random.uniform(size=(rows, inputs))
                y = function(x) + noise * random.standard_normal(rows)
                x_test = random.uniform(size=(10_000, inputs))
                truth = function(x_test)
                with tempfile.TemporaryDirectory() as folder:
                    error, seconds = ours(folder, (x, y), (x_test, truth))
                errors[names[0]].append(error)
                times[names[0]].append(seconds)
                for name, method in methods(seed).items():
                    start = time.process_time()
                    method.fit(x, y)
                    times[name].append(time.process_time() - start)
                    errors[name].append(rmse(method.predict(x_test), truth))
            cells = []
            for name in names:
                mean, spread = np.mean(errors[name]), np.std(errors[name], ddof=1)
                ratio = np.median(np.divide(times[name], times[names[0]]))
                cells.append(f"{mean:.3g} ± {spread:.1g}, {ratio:.2g}")
            print(f"| {problem}, {rows} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
