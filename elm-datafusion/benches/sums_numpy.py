"""The NumPy program that `elm fit` is compared with: reads Parquet files in batches and sums H'H and H'y.

    python sums_numpy.py 'FOLDER/*.parquet' NEURONS THREADS
"""

import glob
import os
import sys
import time

pattern, neurons, threads = sys.argv[1], int(sys.argv[2]), sys.argv[3]
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[name] = threads

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

pa.set_cpu_count(int(threads))
start = time.perf_counter()
files = sorted(glob.glob(pattern))
inputs = [name for name in pq.read_schema(files[0]).names if name.startswith("x")]


def batches():
    for file in files:
        for batch in pq.ParquetFile(file).iter_batches(8192, columns=[*inputs, "y"]):
            columns = [batch.column(i).to_numpy(zero_copy_only=False) for i in range(len(inputs) + 1)]
            yield np.column_stack(columns[:-1]), columns[-1]


rows, total, squares = 0, 0.0, 0.0
for x, _ in batches():
    rows, total, squares = rows + len(x), total + x.sum(0), squares + (x * x).sum(0)
mean = total / rows
deviation = np.sqrt(squares / rows - mean**2)

random = np.random.default_rng(0)
weights = random.uniform(-1, 1, (len(inputs), neurons))
biases = random.uniform(-1, 1, neurons)
gram, moment = np.zeros((neurons + 1, neurons + 1)), np.zeros(neurons + 1)
for x, y in batches():
    hidden = np.empty((len(x), neurons + 1))
    np.tanh(((x - mean) / deviation) @ weights + biases, out=hidden[:, :-1])
    hidden[:, -1] = 1
    gram += hidden.T @ hidden
    moment += hidden.T @ y
gram[np.diag_indices(neurons)] += 1e-10 * np.linalg.eigvalsh(gram)[-1]
beta = np.linalg.solve(gram, moment)
print(f"{time.perf_counter() - start:.2f} s, {rows} rows, {neurons} neurons")
