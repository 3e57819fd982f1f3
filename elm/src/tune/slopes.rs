//! From the slopes of a network to scales of what its neurons see.

/// The smallest scale relative to the largest.
const MIN_RELEVANCE: f64 = 0.01;

/// Scales in proportion to a power of the slopes, so that a weighted sum keeps its size; nothing where there
/// are no slopes.
pub(super) fn proportional(slopes: &[f64], power: f64) -> Option<Vec<f64>> {
    let largest = slopes.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let relative = slopes
        .iter()
        .map(|s| (s / largest).max(MIN_RELEVANCE).powf(power));
    let relative: Vec<f64> = relative.collect();
    let mean_square = relative.iter().map(|s| s * s).sum::<f64>() / relative.len() as f64;
    let size = mean_square.sqrt();
    Some(relative.iter().map(|s| s / size).collect())
}
