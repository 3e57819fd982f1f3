//! Threads of fits and predictions.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::settings::error;

/// By process, as threads do not outlive a fork, and number of threads.
static POOLS: LazyLock<Mutex<Pools>> = LazyLock::new(Mutex::default);

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

/// What `work` gives on this number of threads, the interpreter's lock released meanwhile.
///
/// Never on a pool of the whole process: its threads would be missing in a forked one.
pub(crate) fn on_threads<R: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    let pool = pool(threads)?;
    py.detach(|| match pool {
        Some(pool) => Ok(pool.install(work)),
        None => elm::on_threads(1, work).map_err(error),
    })
}

/// A pool of this many threads; nothing for one, which is the caller's own.
fn pool(threads: usize) -> PyResult<Option<Arc<ThreadPool>>> {
    if threads < 2 {
        return Ok(None);
    }
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Ok(Some(pool.clone()));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    let pool = Arc::new(pool);
    pools.insert(key, pool.clone());
    Ok(Some(pool))
}
