"""The loop over groups that one query is compared with: scikit-learn's Ridge on RBFSampler features.

    python groups_sklearn.py 'FOLDER/*.parquet' NEURONS
"""

import sys
import time
import glob

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from sklearn.kernel_approximation import RBFSampler
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

pattern, neurons = sys.argv[1], int(sys.argv[2])
start = time.perf_counter()
table = pa.concat_tables(pq.read_table(file) for file in sorted(glob.glob(pattern)))
inputs = [name for name in table.column_names if name.startswith("x")]
sensor = table["sensor"].to_numpy()
x = np.column_stack([table[name].to_numpy() for name in inputs])
y = table["y"].to_numpy()
order = np.argsort(sensor, kind="stable")
bounds = np.flatnonzero(np.diff(sensor[order])) + 1
models = {}
for rows in np.split(order, bounds):
    model = make_pipeline(
        StandardScaler(), RBFSampler(n_components=neurons, gamma=0.1, random_state=0), Ridge(1e-3)
    )
    models[sensor[rows[0]]] = model.fit(x[rows], y[rows])
print(f"{time.perf_counter() - start:.2f} s, {len(models)} groups, {len(y)} rows, {neurons} neurons")
