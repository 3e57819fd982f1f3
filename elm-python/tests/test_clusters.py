"""The examples for clusters, whose workers are separate processes and are killed."""

import importlib.util
import os
import shutil
import signal
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from elm_learn import ElmRegressor, merge

pd = pytest.importorskip("pandas")
FILES, ROWS = 6, 2000


def example(name):
    """A script of the examples; the tests lie beside a copy of them."""
    here = Path(__file__).resolve().parent
    found = [folder / f"{name}.py" for folder in (here, here.parent / "examples")]
    path = next(path for path in found if path.exists())
    spec = importlib.util.spec_from_file_location(name, path)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rows")
    rng = np.random.default_rng(0)
    for number in range(FILES):
        X = rng.uniform(-2, 2, (ROWS, 3))
        frame = pd.DataFrame(X, columns=["a", "b", "c"])
        frame["y"] = np.sin(X[:, 0]) * X[:, 1] + X[:, 2] + 0.01 * rng.standard_normal(ROWS)
        frame.to_parquet(folder / f"{number}.parquet")
    return folder


def begin(files):
    """A model without rows, and all rows."""
    frames = [pd.read_parquet(path) for path in sorted(files.glob("*.parquet"))]
    X, y = frames[0].drop(columns="y"), frames[0]["y"]
    return ElmRegressor(60, random_state=0).prepare(X, y), pd.concat(frames)


def killing(function, marker, kill):
    """`function`, whose first call outside of this process kills the worker that runs it."""
    driver, marker = os.getpid(), str(marker)

    def killed(*arguments):
        if os.getpid() != driver:
            try:
                os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
            except FileExistsError:
                pass
            else:
                kill()
        return function(*arguments)

    return killed


def itself():
    os.kill(os.getpid(), signal.SIGKILL)


def executor():
    """The Java process that started the daemon that started this one."""
    with open(f"/proc/{os.getppid()}/stat") as stat:
        os.kill(int(stat.read().rsplit(")", 1)[1].split()[1]), signal.SIGKILL)


PHASES = ["nobody is killed", "while learning", "while merging"]


def armed(module, phase, marker, kill):
    """The example, with a worker killed in that phase."""
    import copy

    if phase == "while learning":
        module.copy = types.SimpleNamespace(deepcopy=killing(copy.deepcopy, marker, kill))
    if phase == "while merging":
        module.merge = killing(merge, marker, kill)
    return module


def check(model, start, rows):
    X = rows.drop(columns="y")
    here = start.partial_fit(X, rows["y"])
    assert model.n_rows_ == FILES * ROWS
    # Of the order of condition times epsilon.
    np.testing.assert_allclose(model.predict(X), here.predict(X), atol=1e-8)


@pytest.mark.parametrize("phase", PHASES)
def test_dask_gives_the_model_of_one_process(files, phase, tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    import cloudpickle

    marker = tmp_path / "killed"
    module = armed(example("with_dask"), phase, marker, itself)
    for travels in (module, __import__(__name__)):
        cloudpickle.register_pickle_by_value(travels)
    start, rows = begin(files)
    paths = sorted(map(str, files.glob("*.parquet")))
    with distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster):
            model = module.fit(paths, "y", start)
    check(model, start, rows)
    assert marker.exists() == (phase != PHASES[0])


@pytest.fixture(scope="module")
def spark():
    """A session whose executors are processes of their own."""
    pytest.importorskip("pyspark")
    if shutil.which("java") is None:
        pytest.skip("java is not installed")
    from pyspark.sql import SparkSession

    os.environ.update(SPARK_LOCAL_IP="127.0.0.1", PYSPARK_PYTHON=sys.executable)
    builder = SparkSession.builder.master("local-cluster[2,1,1024]")
    builder = builder.config("spark.ui.enabled", "false")
    # A task for each file.
    builder = builder.config("spark.sql.files.maxPartitionBytes", "65536")
    session = builder.getOrCreate()
    yield session
    session.stop()


@pytest.mark.parametrize("phase", PHASES)
def test_spark_gives_the_model_of_one_process(spark, files, phase, tmp_path):
    from pyspark import cloudpickle

    marker = tmp_path / "killed"
    module = armed(example("with_spark"), phase, marker, executor)
    for travels in (module, __import__(__name__)):
        cloudpickle.register_pickle_by_value(travels)
    start, rows = begin(files)
    model = module.fit(spark.read.parquet(str(files)), "y", start)
    check(model, start, rows)
    assert marker.exists() == (phase != PHASES[0])
