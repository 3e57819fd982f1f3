//! Repeated timing by the wall clock.

use std::time::Instant;

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
