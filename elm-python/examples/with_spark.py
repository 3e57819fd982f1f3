"""One model of many Parquet files, learned and merged by Spark's executors.

spark-submit with_spark.py 'rows/*.parquet' TARGET MODEL.pkl
"""

import copy
import pickle
import sys

import joblib
from elm_learn import ElmRegressor, merge
from pyspark.sql import SparkSession


def fit(rows, target, start):
    """The model of all rows of a data frame; `start` is prepared and has none yet."""

    def learn(batches):
        import pyarrow

        model = copy.deepcopy(start)
        for batch in batches:
            frame = batch.to_pandas()
            model.partial_fit(frame.drop(columns=target), frame[target])
        yield pyarrow.record_batch({"model": [pickle.dumps(model.compact())]})

    models = rows.mapInArrow(learn, "model binary").rdd.map(lambda row: pickle.loads(row.model))
    return models.treeReduce(lambda one, other: merge([one, other]))


if __name__ == "__main__":
    pattern, target, path = sys.argv[1:]
    rows = SparkSession.builder.getOrCreate().read.parquet(pattern)
    sample = rows.limit(10_000).toPandas()
    start = ElmRegressor(200, random_state=0)
    start.prepare(sample.drop(columns=target), sample[target])
    model = fit(rows, target, start)
    joblib.dump(model, path)
    print(f"{model.n_rows_} rows, {model.n_neurons} neurons: {path}")
