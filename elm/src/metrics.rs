//! Measures of error between a prediction and the truth.
//!
//! ```
//! use elm::metrics::{correlation, mae, rmse};
//! use ndarray::array;
//!
//! let (predicted, truth) = (array![1.0, 2.0, 5.0], array![1.0, 3.0, 4.0]);
//! assert_eq!(rmse(&predicted, &truth)?, (2.0_f64 / 3.0).sqrt());
//! assert_eq!(mae(&predicted, &truth)?, 2.0 / 3.0);
//! assert_eq!(correlation(&predicted, &array![7.0, 7.0, 7.0])?, None);
//! # Ok::<(), elm::Error>(())
//! ```

use ndarray::{Array1, ArrayRef1, ArrayView1, ArrayView2, Axis};

use crate::check::check_length;
use crate::error::{Error, Result};
use crate::scalar::{Scalar, power_of_two};
use crate::stats::{Sum, sum};

/// Root mean squared error.
///
/// # Errors
/// [`Error::Shape`] when the lengths differ, [`Error::Empty`] when there is nothing to compare,
/// [`Error::NotFinite`] for a NaN or infinity.
pub fn rmse<A: Scalar>(predicted: &ArrayRef1<A>, truth: &ArrayRef1<A>) -> Result<f64> {
    check_lengths(predicted, truth)?;
    let squares = sum(pairs(predicted, truth).map(|(p, t)| (p - t) * (p - t)));
    if in_range(squares) {
        return Ok((squares / truth.len() as f64).sqrt());
    }
    check_finite(predicted, truth)?;
    let errors = pairs(predicted, truth).map(|(p, t)| (p - t, 1.0));
    Ok(scaled_root_mean_square(errors))
}

/// Mean absolute error.
///
/// # Errors
/// [`Error::Shape`] when the lengths differ, [`Error::Empty`] when there is nothing to compare,
/// [`Error::NotFinite`] for a NaN or infinity.
pub fn mae<A: Scalar>(predicted: &ArrayRef1<A>, truth: &ArrayRef1<A>) -> Result<f64> {
    check_lengths(predicted, truth)?;
    let n = truth.len() as f64;
    let errors = || pairs(predicted, truth).map(|(p, t)| (p - t).abs());
    let whole = sum(errors());
    if whole.is_finite() {
        return Ok(whole / n);
    }
    check_finite(predicted, truth)?;
    // Divided before it is summed: the sum of many errors of 1e308 is out of range.
    Ok(sum(errors().map(|error| error / n)))
}

/// Pearson's correlation coefficient; `None` where it does not exist, that is, where the values of
/// one of the two are all equal.
///
/// # Errors
/// [`Error::Shape`] when the lengths differ, [`Error::Empty`] when there is nothing to compare,
/// [`Error::NotFinite`] for a NaN or infinity.
pub fn correlation<A: Scalar>(
    predicted: &ArrayRef1<A>,
    truth: &ArrayRef1<A>,
) -> Result<Option<f64>> {
    check_lengths(predicted, truth)?;
    let mut sums = CentredSums::of(pairs(predicted, truth));
    if !(in_range(sums.pp) && in_range(sums.tt)) {
        check_finite(predicted, truth)?;
        let factor = |x: &ArrayRef1<A>| {
            let largest = x.iter().fold(0.0, |m: f64, v| m.max(v.as_f64().abs()));
            power_of_two(largest).recip()
        };
        let (factor_p, factor_t) = (factor(predicted), factor(truth));
        let scaled = pairs(predicted, truth).map(|(p, t)| (p * factor_p, t * factor_t));
        sums = CentredSums::of(scaled);
    }
    let varies = sums.pp > 0.0 && sums.tt > 0.0;
    if !varies || is_constant(predicted) || is_constant(truth) {
        return Ok(None);
    }
    let r = sums.pt / (sums.pp.sqrt() * sums.tt.sqrt());
    Ok(Some(r.clamp(-1.0, 1.0)))
}

/// Whether all values are equal: their mean may round, so that their sum of squares about it need not
/// be 0.
fn is_constant<A: Scalar>(values: &ArrayRef1<A>) -> bool {
    values.iter().all(|value| *value == values[0])
}

/// Of two columns the sums of squares and products about their means.
struct CentredSums {
    pp: f64,
    tt: f64,
    pt: f64,
}

impl CentredSums {
    fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let (mut n, mut sum_p, mut sum_t) = (0.0, Sum::default(), Sum::default());
        for (p, t) in pairs.clone() {
            n += 1.0;
            sum_p.add(p);
            sum_t.add(t);
        }
        let (mean_p, mean_t) = (sum_p.value() / n, sum_t.value() / n);
        let (mut rest_p, mut rest_t) = (Sum::default(), Sum::default());
        let (mut pp, mut tt, mut pt) = (Sum::default(), Sum::default(), Sum::default());
        for (p, t) in pairs {
            let (p, t) = (p - mean_p, t - mean_t);
            rest_p.add(p);
            rest_t.add(t);
            pp.add(p * p);
            tt.add(t * t);
            pt.add(p * t);
        }
        // What the means have missed, and what that has added.
        let (rest_p, rest_t) = (rest_p.value(), rest_t.value());
        pp.add(-rest_p * rest_p / n);
        tt.add(-rest_t * rest_t / n);
        pt.add(-rest_p * rest_t / n);
        Self {
            pp: pp.value(),
            tt: tt.value(),
            pt: pt.value(),
        }
    }
}

/// Whether a sum of squares has neither overflowed nor lost what is too small to be squared; of
/// nothing but zeros, or of a NaN, that is not known.
fn in_range(squares: f64) -> bool {
    (1e-200..f64::INFINITY).contains(&squares)
}

/// Root of the weighted mean of squares; 0 of nothing.
pub(crate) fn root_mean_square<A: Scalar>(
    values: ArrayView1<'_, A>,
    weights: ArrayView1<'_, A>,
) -> f64 {
    let pairs = values.iter().zip(weights);
    scaled_root_mean_square(pairs.map(|(v, w)| (v.as_f64(), w.as_f64())))
}

/// Root of the mean of squares of each column.
pub(crate) fn root_mean_squares<A: Scalar>(values: ArrayView2<'_, A>) -> Array1<f64> {
    values.map_axis(Axis(0), |column| {
        scaled_root_mean_square(column.iter().map(|value| (value.as_f64(), 1.0)))
    })
}

/// Of values and weights. Scaled by a power of two, as squares of 1e200 are out of range.
fn scaled_root_mean_square(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let largest = pairs.clone().fold(0.0, |m: f64, (value, _)| {
        // Unlike f64::max this keeps a NaN.
        if m >= value.abs() || m.is_nan() {
            m
        } else {
            value.abs()
        }
    });
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let unit = power_of_two(largest);
    let factor = unit.recip();
    let (mut squares, mut total) = (Sum::default(), Sum::default());
    for (value, weight) in pairs {
        squares.add(weight * (value * factor).powi(2));
        total.add(weight);
    }
    unit * (squares.value() / total.value()).sqrt()
}

fn check_lengths<A: Scalar>(predicted: &ArrayRef1<A>, truth: &ArrayRef1<A>) -> Result<()> {
    check_length("predictions", predicted.len(), truth.len())?;
    if truth.is_empty() {
        return Err(Error::Empty {
            what: "truth",
            rows: 0,
            columns: 1,
        });
    }
    Ok(())
}

fn check_finite<A: Scalar>(predicted: &ArrayRef1<A>, truth: &ArrayRef1<A>) -> Result<()> {
    for (what, values) in [("predictions", predicted), ("truth", truth)] {
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let column = 0;
            return Err(Error::NotFinite { what, row, column });
        }
    }
    Ok(())
}

fn pairs<A: Scalar>(
    predicted: &ArrayRef1<A>,
    truth: &ArrayRef1<A>,
) -> impl Iterator<Item = (f64, f64)> + Clone {
    predicted
        .iter()
        .zip(truth)
        .map(|(p, t)| (p.as_f64(), t.as_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, array};

    #[test]
    fn errors_of_a_hand_computed_case() {
        let (p, t) = (array![1.0, 2.0, 3.0, 4.0], array![1.0, 0.0, 3.0, 8.0]);
        assert_eq!(rmse(&p, &t).unwrap(), 5.0_f64.sqrt());
        assert_eq!(mae(&p, &t).unwrap(), 1.5);
        // Deviations (-1.5, -0.5, 0.5, 1.5) and (-2, -3, 0, 5): 12 / sqrt(5 * 38).
        let r = correlation(&p, &t).unwrap().unwrap();
        approx::assert_relative_eq!(r, 12.0 / 190.0_f64.sqrt(), max_relative = 1e-15);
    }

    #[test]
    fn squares_out_of_range_do_no_harm_and_nan_is_named() {
        let zero = Array1::zeros(4);
        for size in [1e-200, 1e200] {
            let p = array![3.0, -4.0, 0.0, 0.0] * size;
            approx::assert_relative_eq!(rmse(&p, &zero).unwrap(), 2.5 * size, max_relative = 1e-15);
        }
        for place in 0..4 {
            let mut p = array![1.0, 2.0, 3.0, 4.0];
            p[place] = f64::NAN;
            let expected = Error::NotFinite {
                what: "predictions",
                row: place,
                column: 0,
            };
            assert_eq!(rmse(&p, &zero), Err(expected.clone()));
            assert_eq!(mae(&p, &zero), Err(expected.clone()));
            assert_eq!(correlation(&p, &zero), Err(expected));
        }
    }

    #[test]
    fn scale_does_not_change_a_correlation() {
        let (p, t) = (array![1.0, 2.0, 3.0, 4.0], array![1.0, 0.0, 3.0, 8.0]);
        let r = correlation(&p, &t).unwrap().unwrap();
        for (a, b) in [
            (1e-200, 1e-200),
            (1e200, 1e-200),
            (1e307, 1e300),
            (1e-310, 1.0),
        ] {
            let found = correlation(&(&p * a), &(&t * b)).unwrap().unwrap();
            approx::assert_relative_eq!(found, r, max_relative = 1e-12);
        }
    }

    #[test]
    fn a_constant_has_no_correlation() {
        let (constant, t) = (Array1::from_elem(7, 0.1), Array1::linspace(0.0, 1.0, 7));
        assert_eq!(correlation(&constant, &t).unwrap(), None);
        assert_eq!(correlation(&t, &constant).unwrap(), None);
    }

    #[test]
    fn a_million_rows_cost_neither_a_constant_nor_a_small_variation() {
        let rows = 1_000_000;
        let t = Array1::from_shape_fn(rows, |row| f64::from((row % 7) as u8));
        let constant = Array1::from_elem(rows, 273.15);
        assert_eq!(correlation(&constant, &t).unwrap(), None);
        // Exact multiples of 2^-30 beside a mean of 1e6.
        let small = t.mapv(|t| 1e6 + t * 0.5_f64.powi(30));
        let r = correlation(&small, &t).unwrap().unwrap();
        approx::assert_relative_eq!(r, 1.0, max_relative = 1e-14);
        let wrong = &constant + 0.1;
        let error = (273.15 + 0.1) - 273.15;
        for found in [mae(&wrong, &constant), rmse(&wrong, &constant)] {
            approx::assert_relative_eq!(found.unwrap(), error, max_relative = 2.0 * f64::EPSILON);
        }
    }

    #[test]
    fn lengths_must_agree_and_not_be_zero() {
        let (short, long, none) = (array![1.0], array![1.0, 2.0], Array1::<f64>::zeros(0));
        assert!(matches!(
            rmse(&short, &long),
            Err(Error::Shape {
                expected: 2,
                found: 1,
                ..
            })
        ));
        assert!(matches!(mae(&none, &none), Err(Error::Empty { .. })));
    }
}
