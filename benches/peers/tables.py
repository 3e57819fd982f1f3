"""scikit-learn on a regression table, one request a line: what `elm-benches tables` compares with.

Each method is used as its user would: settings by the error on a quarter of the training rows, from
the grids below, then fitted to all of them. Seconds are processor time of choosing and fitting, one
thread.
"""

import json
import os
import sys
import time
import warnings

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402
import sklearn  # noqa: E402
from sklearn.compose import TransformedTargetRegressor  # noqa: E402
from sklearn.ensemble import HistGradientBoostingRegressor  # noqa: E402
from sklearn.kernel_ridge import KernelRidge  # noqa: E402
from sklearn.linear_model import RidgeCV  # noqa: E402
from sklearn.neural_network import MLPRegressor  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import StandardScaler  # noqa: E402

warnings.simplefilter("ignore")

# Rows that kernel ridge chooses its settings on: its time is the cube of them.
KERNEL_SEARCH = 2000


def standardised(model):
    return make_pipeline(
        StandardScaler(),
        TransformedTargetRegressor(model, transformer=StandardScaler()),
    )


def linear(seed, inputs):
    return [standardised(RidgeCV(np.logspace(-6, 4, 21)))]


def boosting(seed, inputs):
    return [
        HistGradientBoostingRegressor(
            learning_rate=rate,
            max_leaf_nodes=leaves,
            max_iter=500,
            early_stopping=True,
            n_iter_no_change=20,
            random_state=seed,
        )
        for rate in (0.05, 0.1)
        for leaves in (15, 31)
    ]


def perceptron(seed, inputs):
    return [
        standardised(
            MLPRegressor(
                hidden_layer_sizes=(64, 64),
                alpha=alpha,
                max_iter=500,
                early_stopping=True,
                random_state=seed,
            )
        )
        for alpha in (1e-4, 1e-2, 1.0)
    ]


def kernel(seed, inputs):
    return [
        standardised(KernelRidge(kernel="rbf", gamma=factor / inputs, alpha=alpha))
        for factor in (0.01, 0.03, 0.1, 0.3, 1.0)
        for alpha in (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    ]


METHODS = {"linear": linear, "HistGB": boosting, "MLP": perceptron, "KRR": kernel}


def rmse(a, b):
    return float(np.sqrt(np.mean((a - b) ** 2)))


def fit(method, train, test, seed):
    x, y = train[:, :-1], train[:, -1]
    before = time.process_time()
    candidates = METHODS[method](seed, x.shape[1])
    best = candidates[0]
    if len(candidates) > 1:
        order = np.random.default_rng(seed).permutation(len(y))
        if method == "KRR":
            order = order[:KERNEL_SEARCH]
        held, kept = np.split(order, [len(order) // 4])
        errors = [
            rmse(c.fit(x[kept], y[kept]).predict(x[held]), y[held]) for c in candidates
        ]
        best = candidates[int(np.argmin(errors))]
    best.fit(x, y)
    seconds = time.process_time() - before
    return {"rmse": rmse(best.predict(test[:, :-1]), test[:, -1]), "seconds": seconds}


def answer(request):
    if request["do"] == "about":
        return {"text": f"scikit-learn {sklearn.__version__}, numpy {np.__version__}"}
    train, test = (
        np.fromfile(request[name]).reshape(-1, request["columns"]) for name in ("train", "test")
    )
    return fit(request["method"], train, test, request["seed"])


def main():
    for line in sys.stdin:
        try:
            reply = answer(json.loads(line))
        except Exception as error:  # what went wrong is the caller's to say
            reply = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(reply), flush=True)


if __name__ == "__main__":
    main()
