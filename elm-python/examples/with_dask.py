"""One model of many Parquet files, learned and merged by Dask's workers.

python with_dask.py 'rows/*.parquet' TARGET MODEL.pkl [tcp://SCHEDULER:8786]
"""

import copy
import glob
import sys

import dask.bag
import joblib
import pandas as pd
from dask.distributed import Client
from elm_learn import ElmRegressor, merge


def fit(files, target, start):
    """The model of all rows of the files; `start` is prepared and has none yet."""

    def learn(file):
        rows = pd.read_parquet(file)
        # A copy each time: a task that runs again must not find its rows there already.
        return copy.deepcopy(start).partial_fit(rows.drop(columns=target), rows[target]).compact()

    models = dask.bag.from_sequence(files, partition_size=1).map(learn)
    return models.reduction(merge, merge, split_every=8).compute()


if __name__ == "__main__":
    pattern, target, path, *scheduler = sys.argv[1:]
    files = sorted(glob.glob(pattern))
    sample = pd.read_parquet(files[0]).head(10_000)
    start = ElmRegressor(200, random_state=0)
    start.prepare(sample.drop(columns=target), sample[target])
    with Client(*scheduler):
        model = fit(files, target, start)
    joblib.dump(model, path)
    print(f"{model.n_rows_} rows, {model.n_neurons} neurons: {path}")
