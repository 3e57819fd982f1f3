"""The Python side of `cargo run --release -p elm-benches --bin peers`.

Reads one request per line from standard input, as JSON, and answers each with one line. Times are
processor time of this process, in seconds per call.
"""

import json
import os
import sys
import time
import warnings

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info

warnings.simplefilter("ignore")


class Standardised:
    """Inputs with mean 0 and deviation 1, as every ELM here is given them."""

    def prepare(self, x):
        self.mean, self.deviation = x.mean(0), x.std(0)
        self.deviation[self.deviation == 0] = 1
        return self.scaled(x)

    def scaled(self, x):
        return (x - self.mean) / self.deviation


class RandomFeatures(Standardised):
    """tanh features; the layer is standard normal, or given: that of our network."""

    def __init__(self, neurons, layer, alpha, seed):
        self.neurons, self.layer, self.alpha, self.seed = neurons, layer, alpha, seed

    def hidden(self, x):
        x = self.prepare(x)
        if self.layer is None:
            random = np.random.default_rng(self.seed)
            self.weights = random.standard_normal((x.shape[1], self.neurons))
            self.biases = random.standard_normal(self.neurons)
        else:
            self.weights, self.biases = self.layer
        return np.tanh(x @ self.weights + self.biases)

    def pack(self):
        # Standardisation folded into the weights: nothing is left but the products and tanh.
        self.weights = self.weights / self.deviation[:, None]
        self.biases = self.biases - self.mean @ self.weights

    def predict(self, x):
        return np.tanh(x @ self.weights + self.biases) @ self.beta


class NumpyLstsq(RandomFeatures):
    def fit(self, x, t):
        self.beta = np.linalg.lstsq(self.hidden(x), t)[0]
        self.pack()


class ScipyCholesky(RandomFeatures):
    def fit(self, x, t):
        hidden = self.hidden(x)
        gram = hidden.T @ hidden
        gram.flat[:: self.neurons + 1] += self.alpha
        factor = scipy.linalg.cho_factor(gram, lower=True, overwrite_a=True, check_finite=False)
        right = hidden.T @ t
        self.beta = scipy.linalg.cho_solve(factor, right, overwrite_b=True, check_finite=False)
        self.pack()


class SklearnRidge(RandomFeatures):
    def fit(self, x, t):
        from sklearn.linear_model import Ridge

        ridge = Ridge(alpha=self.alpha, solver="cholesky")
        ridge.fit(self.hidden(x), t)
        self.beta, self.intercept = ridge.coef_.T.reshape(self.neurons, -1), ridge.intercept_
        self.pack()

    def predict(self, x):
        return super().predict(x) + self.intercept


class Hpelm(Standardised):
    def __init__(self, neurons, layer, alpha, seed):
        self.neurons, self.layer, self.alpha, self.seed = neurons, layer, alpha, seed

    def fit(self, x, t):
        import hpelm

        x = self.prepare(x)
        np.random.seed(self.seed)
        self.model = hpelm.ELM(x.shape[1], t.shape[1], norm=self.alpha)
        if self.layer is None:
            self.model.add_neurons(self.neurons, "tanh")
        else:
            self.model.add_neurons(self.neurons, "tanh", *self.layer)
        self.model.train(x, t, "r")

    def predict(self, x):
        return self.model.predict(self.scaled(x))


class Sklearn(Standardised):
    """A regressor of scikit-learn with its default settings, but for those named."""

    def __init__(self, neurons, layer, alpha, seed):
        self.seed = seed

    def fit(self, x, t):
        x = self.prepare(x)
        self.model = self.make(x, t)
        self.model.fit(x, t if t.shape[1] > 1 else t[:, 0])
        self.outputs = t.shape[1]

    def predict(self, x):
        return self.model.predict(self.scaled(x)).reshape(len(x), self.outputs)


class KernelRidge(Sklearn):
    def make(self, x, t):
        from sklearn.kernel_ridge import KernelRidge

        return KernelRidge(kernel="rbf", gamma=0.5 / x.shape[1], alpha=1e-2)


class Mlp(Sklearn):
    def make(self, x, t):
        from sklearn.neural_network import MLPRegressor

        return MLPRegressor(early_stopping=True, random_state=self.seed)


class HistGradientBoosting(Sklearn):
    def make(self, x, t):
        from sklearn.ensemble import HistGradientBoostingRegressor
        from sklearn.multioutput import MultiOutputRegressor

        one = HistGradientBoostingRegressor(random_state=self.seed)
        return one if t.shape[1] == 1 else MultiOutputRegressor(one)


PEERS = {
    "numpy lstsq": NumpyLstsq,
    "scipy cholesky": ScipyCholesky,
    "sklearn ridge": SklearnRidge,
    "hpelm": Hpelm,
    "sklearn KernelRidge": KernelRidge,
    "sklearn MLPRegressor": Mlp,
    "sklearn HistGradientBoosting": HistGradientBoosting,
}


def matrix(path, rows, columns):
    return np.fromfile(path, dtype="<f8").reshape(rows, columns)


def per_call(work, least_seconds):
    """Time of a call, of as many as take `least_seconds` together: of the processor, or with several threads on the clock."""
    alone = os.environ.get("OMP_NUM_THREADS") == "1"
    clock = time.process_time if alone else time.perf_counter
    calls = 1
    while True:
        start = clock()
        for _ in range(calls):
            work()
        seconds = clock() - start
        if seconds >= least_seconds or calls >= 1 << 20:
            return seconds / calls
        calls = max(2 * calls, int(calls * 1.2 * least_seconds / max(seconds, 1e-9)))
        calls = min(calls, 1 << 20)


def rmse(model, x, t):
    return float(np.sqrt(np.mean((model.predict(x) - t) ** 2)))


def high_water(reset):
    """(peak, present) resident bytes since the last reset; None where the system cannot say."""
    try:
        if reset:
            with open("/proc/self/clear_refs", "w") as file:
                file.write("5")
        with open("/proc/self/status") as file:
            lines = dict(line.split(":", 1) for line in file)
        return [1024 * int(lines[key].split()[0]) for key in ("VmHWM", "VmRSS")]
    except (OSError, KeyError, ValueError):
        return None


class Worker:
    def load(self, request):
        rows, tests, inputs, outputs = (
            request[key] for key in ("rows", "test_rows", "inputs", "outputs")
        )
        folder = request["folder"]
        self.x = matrix(f"{folder}/x", rows, inputs)
        self.t = matrix(f"{folder}/t", rows, outputs)
        self.test_x = matrix(f"{folder}/test_x", tests, inputs)
        self.test_t = matrix(f"{folder}/test_t", tests, outputs)
        neurons = request["neurons"]
        self.layer = (
            matrix(f"{folder}/weights", inputs, neurons), matrix(f"{folder}/biases", 1, neurons)[0]
        )

    def make(self, request, neurons=None):
        layer = self.layer if request["our_layer"] and neurons is None else None
        return PEERS[request["peer"]](
            neurons or request["neurons"], layer, request["alpha"], request["seed"]
        )

    def fit(self, request):
        def once():
            self.model = self.make(request)
            self.model.fit(self.x, self.t)

        seconds = per_call(once, request["least_seconds"])
        return {"seconds": seconds, "rmse": rmse(self.model, self.test_x, self.test_t)}

    def predict_batch(self, request):
        return {
            "seconds": per_call(lambda: self.model.predict(self.test_x), request["least_seconds"])
        }

    def predict_one(self, request):
        row = self.test_x[:1].copy()
        return {"seconds": per_call(lambda: self.model.predict(row), request["least_seconds"])}

    def memory(self, request):
        # A small fit first: what an import needs is not what a fit needs.
        warm = self.make(request, neurons=4)
        warm.fit(self.x[:50], self.t[:50])
        before = high_water(reset=True)
        self.make(request).fit(self.x, self.t)
        after = high_water(reset=False)
        return {"bytes": after[0] - before[1] if before and after else None}

    def about(self, request):
        blas = sorted(
            {f"{i['internal_api']} {i['version']} {i.get('architecture')}" for i in threadpool_info()
             if i["user_api"] == "blas"}
        )
        threads = max((i["num_threads"] for i in threadpool_info()), default=1)
        import sklearn

        return {
            "text": f"Python {sys.version.split()[0]}, numpy {np.__version__}, "
            f"scipy {scipy.__version__}, scikit-learn {sklearn.__version__}, "
            f"{', '.join(blas)}, {threads} thread(s)"
        }


def main():
    worker = Worker()
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = getattr(worker, request["do"])(request) or {}
        except Exception as error:  # the other side reports it
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
