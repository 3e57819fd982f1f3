//! Candidates for the scales of inputs, the same for networks and for Gaussian processes.

use ndarray::Array2;

/// Scales within a range, shape (candidates, inputs): an additive recurrence, evenly spread in the
/// logarithm.
///
/// M. Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018.
pub(crate) fn spread(candidates: usize, inputs: usize, range: (f64, f64)) -> Array2<f64> {
    // The root of x^(d+1) = x + 1, by fixed-point iteration.
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (inputs as f64 + 1.0));
    }
    let (low, high) = (range.0.ln(), range.1.ln());
    Array2::from_shape_fn((candidates, inputs), |(candidate, input)| {
        let step = root.powi(-(input as i32 + 1));
        let place = (0.5 + (candidate as f64 + 1.0) * step).fract();
        (low + place * (high - low)).exp()
    })
}
