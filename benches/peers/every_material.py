"""The whole paper in NumPy as a user would write it: one pseudo-inverse for every material and fold.

    cargo run --release -p elm-benches --bin paper_time -- [CURET_DIR]

runs this and compares time and results. Per request (one line of JSON on standard input, naming a
folder of little-endian f64 files and their sizes) one line of JSON: processor seconds, and the six
measures of every material over training rows, held-out rows, and as a mean over folds.
"""

import json
import sys
import time

import numpy as np


def sigmoid(z):
    return 1 / (1 + np.exp(-z))


def measures(predicted, truth, cosine):
    difference = predicted - truth
    rmse = np.sqrt(np.mean(difference**2))
    logs = np.log1p(np.maximum(predicted * cosine, np.finfo(float).eps - 1)) - np.log1p(truth * cosine)
    return [
        rmse,
        np.mean(np.abs(difference)),
        np.corrcoef(predicted, truth)[0, 1],
        rmse / np.sqrt(np.mean(truth**2)),
        np.mean(np.abs(logs)),
        np.sqrt(np.mean((np.cbrt(predicted) - np.cbrt(truth)) ** 2)),
    ]


def material(inputs, truth, cosine, fold, weights, biases):
    held_out = np.empty_like(truth)
    trained, trained_truth, trained_cosine, of_folds = [], [], [], []
    for k in range(int(fold.max()) + 1):
        train, test = fold != k, fold == k
        mean, deviation = inputs[train].mean(0), inputs[train].std(0)
        hidden = sigmoid((inputs - mean) / deviation @ weights + biases)
        beta = np.linalg.pinv(hidden[train]) @ truth[train]
        predicted = hidden @ beta
        held_out[test] = predicted[test]
        trained.append(predicted[train])
        trained_truth.append(truth[train])
        trained_cosine.append(cosine[train])
        of_folds.append(measures(predicted[test], truth[test], cosine[test]))
    whole = [np.concatenate(parts) for parts in (trained, trained_truth, trained_cosine)]
    return [
        measures(*whole),
        measures(held_out, truth, cosine),
        list(np.mean(of_folds, axis=0)),
    ]


def main():
    for line in sys.stdin:
        request = json.loads(line)

        def load(name, *shape):
            return np.fromfile(f"{request['folder']}/{name}", dtype="<f8").reshape(shape)

        rows, materials, neurons = request["rows"], request["materials"], request["neurons"]
        inputs, values = load("inputs", rows, 6), load("values", rows, materials)
        cosine, fold = load("cosine", rows), load("fold", rows)
        weights, biases = load("weights", 6, neurons), load("biases", neurons)
        start = time.process_time()
        scores = [
            material(inputs, values[:, m].copy(), cosine, fold, weights, biases)
            for m in range(materials)
        ]
        seconds = time.process_time() - start
        print(json.dumps({"seconds": seconds, "scores": np.array(scores).tolist()}), flush=True)


if __name__ == "__main__":
    main()
