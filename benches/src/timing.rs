//! Repeated timing: medians, and seconds by the wall clock of one thread.

use std::time::Instant;

/// The median of `repetitions` timings of `work`, in seconds per call.
///
/// Calls are gathered until a timing takes at least 2 ms, so that the clock's resolution does not
/// matter.
pub fn median_seconds(repetitions: usize, mut work: impl FnMut()) -> f64 {
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
    median(
        (0..repetitions.max(1))
            .map(|_| once(calls, &mut work) / f64::from(calls))
            .collect(),
    )
}

/// The median; 0 of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
