//! Repeated timing, on as many threads as are asked for.

use std::sync::{LazyLock, OnceLock};
use std::time::Instant;

static THREADS: OnceLock<usize> = OnceLock::new();

/// Keeps whatever the library does to this number of threads; before anything else.
pub fn use_threads(threads: usize) {
    // The second of two calls is without effect.
    drop(
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global(),
    );
    THREADS.get_or_init(|| threads);
}

/// The number of threads that measurements are made on.
#[must_use]
pub fn threads() -> usize {
    THREADS.get().copied().unwrap_or(1)
}

/// The fastest of `repetitions` timings of `work`, in seconds per call: what the machine can do,
/// to which other processes only add.
///
/// Calls are gathered until a timing takes at least 2 ms, so that the clock's resolution does not
/// matter.
pub fn fastest_seconds(repetitions: usize, mut work: impl FnMut()) -> f64 {
    let mut calls = 1_u32;
    let once = |calls: u32, work: &mut dyn FnMut()| {
        let start = Instant::now();
        for _ in 0..calls {
            work();
        }
        start.elapsed().as_secs_f64()
    };
    while once(calls, &mut work) < 2e-3 && calls < 1 << 30 {
        calls *= 2;
    }
    (0..repetitions.max(1))
        .map(|_| once(calls, &mut work) / f64::from(calls))
        .fold(f64::INFINITY, f64::min)
}

/// Processor time that this process has used, in seconds; where the system does not say, and on several
/// threads, the time on the clock.
#[must_use]
pub fn processor_seconds() -> f64 {
    #[cfg(unix)]
    if threads() == 1 {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        return time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9;
    }
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}

/// Processor time of a call, of as many as take `least_seconds` together.
pub fn processor_seconds_per_call(least_seconds: f64, mut work: impl FnMut()) -> f64 {
    let mut calls = 1_u32;
    loop {
        let start = processor_seconds();
        for _ in 0..calls {
            work();
        }
        let seconds = processor_seconds() - start;
        if seconds >= least_seconds || calls >= 1 << 20 {
            return seconds / f64::from(calls);
        }
        let enough = f64::from(calls) * 1.2 * least_seconds / seconds.max(1e-9);
        calls = (enough as u32).max(2 * calls).min(1 << 20);
    }
}

/// The median; `None` of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match (values.len() % 2, values.get(half)) {
        (_, None) => None,
        (1, Some(&middle)) => Some(middle),
        (_, Some(&upper)) => Some(f64::midpoint(values[half - 1], upper)),
    }
}
