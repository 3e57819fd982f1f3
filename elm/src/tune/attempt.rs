//! What a trial came to, and when one is better than another.

use super::Trial;

/// Relative gain below which more neurons, or another scale for an input, do not pay.
const MIN_GAIN: f64 = 0.01;

/// A trial, with the held-out error of each row.
pub(super) struct Attempt {
    pub(super) trial: Trial,
    /// Squared, relative to each output's variance, mean over outputs; times the weight of the row over
    /// the mean weight.
    pub(super) squares: Vec<f64>,
    /// What the score counts for, over what it is: above 1 for small scales.
    pub(super) price: f64,
}

impl Attempt {
    /// Whether the errors are smaller by more than `standard_errors` standard errors of the difference.
    pub(super) fn improves_on(&self, other: &Self, standard_errors: f64) -> bool {
        let priced = |attempt: &Self| attempt.trial.score * attempt.price;
        priced(self) < priced(other) * (1.0 - MIN_GAIN)
            && surely_smaller(&self.squares, &other.squares, standard_errors)
    }
}

/// Whether the mean of `new` is smaller by more than `standard_errors` of the paired difference.
pub(super) fn surely_smaller(new: &[f64], old: &[f64], standard_errors: f64) -> bool {
    let gains = || old.iter().zip(new).map(|(old, new)| old - new);
    let rows = new.len() as f64;
    let mean = gains().sum::<f64>() / rows;
    let variance = gains().map(|gain| (gain - mean).powi(2)).sum::<f64>() / rows;
    mean > standard_errors * (variance / rows).sqrt()
}

/// The search begins at the scale that suits most problems, and leaves it for a reason: small scales
/// make networks that are nearly polynomials, whose errors at the edge of the data few rows show.
pub(super) fn scale_pays(new: &Attempt, old: &Attempt) -> bool {
    new.improves_on(old, 1.5)
}

pub(super) fn neurons_pay(new: &Attempt, old: &Attempt) -> bool {
    new.improves_on(old, 1.0)
}

pub(super) fn links_pay(new: &Attempt, old: &Attempt) -> bool {
    new.improves_on(old, 0.5)
}

pub(super) fn step_pays(new: &Attempt, old: &Attempt) -> bool {
    new.improves_on(old, 0.5)
}

#[test]
fn a_gain_is_sure_where_it_is_larger_than_its_standard_error() {
    let old = [1.0, 1.2, 0.8, 1.0];
    let sure = old.map(|square| square - 0.1);
    assert!(surely_smaller(&sure, &old, 2.0) && !surely_smaller(&old, &sure, 0.0));
    // As large in the mean, but of a single row.
    let luck = [0.6, 1.2, 0.8, 1.0];
    assert!(surely_smaller(&luck, &old, 0.5) && !surely_smaller(&luck, &old, 1.2));
}
